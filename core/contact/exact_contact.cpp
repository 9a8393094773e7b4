#include "contact/exact_contact.hpp"

#include <algorithm>

#include "contact/coulomb.hpp"

namespace fclib {

template <int D>
ExactContact<D>::ExactContact(const Mat& a, double mu) : mu_(mu) {
  normal_ = a(0, 0);
  trace_ = a.trace();
  solvable_ = normal_ > tiny * trace_ && trace_ > 0;
  if (solvable_) {
    to_normal_ = a.template block<1, T>(0, 1).transpose() / normal_;
    to_tangent_ = a.template block<T, 1>(1, 0) / normal_;
    schur_ = a.template block<T, T>(1, 1) - to_tangent_ * a.template block<1, T>(0, 1);
    const double det = determinant(schur_);
    const double size = schur_.norm();
    sticks_ = std::abs(det) > tiny * (T == 1 ? trace_ : size * size) && size > tiny * trace_;
    if (sticks_) inverse_ = shifted_inverse(schur_, 0.0);
    reveal_rank(a);
  }
}

template <int D>
void ExactContact<D>::reveal_rank(const Mat& a) {
  const double least = std::max(rounding * a.template block<T, T>(1, 1).trace(), tiny * trace_);
  if constexpr (T == 1) {
    singular_ = std::abs(schur_(0, 0)) <= least;
    if (!singular_) return;
    schur_.setZero();
  } else {
    const double mean = 0.5 * (schur_(0, 0) + schur_(1, 1));
    const double half = 0.5 * (schur_(0, 0) - schur_(1, 1));
    const double off = 0.5 * (schur_(0, 1) + schur_(1, 0));
    const double radius = std::hypot(half, off);
    const double large = mean < 0 ? mean - radius : mean + radius;
    const double small = mean < 0 ? mean + radius : mean - radius;
    singular_ = std::abs(small) <= least;
    if (!singular_) return;
    schur_.setZero();
    if (std::abs(large) > least) {
      // the eigenvector of `large`, from the longer column of S - small I
      TangentVec along(mean + half - small, off);
      if (mean - half > mean + half) along = TangentVec(off, mean - half - small);
      along.normalize();
      range_ = along * along.transpose();
      schur_ = large * range_;
      inverse_ = range_ / large;
    }
  }
  if (schur_.isZero(0)) inverse_.setZero();
  block_ = a;
}

template <int D>
bool ExactContact<D>::solve_singular(const Vec& b, const TangentVec& c, double free_normal, Vec& r,
                                     double close) {
  TangentVec within = range_ * c;
  const TangentVec across = c - within;
  const double terms = b.template tail<T>().norm() + to_tangent_.norm() * std::abs(b[0]);
  const bool free = across.norm() > rounding_of_c * terms;

  Vec stick;
  stick.template tail<T>() = -inverse_ * c;
  stick[0] = free_normal - to_normal_.dot(stick.template tail<T>());
  const bool sticks =
      stick[0] >= 0 && stick.template tail<T>().norm() <= mu_ * stick[0] && stick.allFinite();
  if (sticks && !free) {
    r = stick;
    return true;
  }
  if (free) within = c;
  Vec slides = r;
  const bool slips = within.squaredNorm() > 0 && slip(within, free_normal, slides, close);
  if (!sticks && !slips) return false;
  const Vec& best = !slips || (sticks && !(left(b, slides) < left(b, stick))) ? stick : slides;
  if (!(left(b, best) <= left(b, r))) return false;
  r = best;
  return true;
}

template <int D>
double ExactContact<D>::left(const Vec& b, const Vec& r) const {
  return natural_map(Coulomb<D>(mu_), Vec(block_ * r + b), r).norm();
}

template class ExactContact<2>;
template class ExactContact<3>;

}  // namespace fclib
