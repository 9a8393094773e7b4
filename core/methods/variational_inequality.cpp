#include "methods/variational_inequality.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "reduced/relative_error.hpp"
#include "reduced/scale.hpp"

namespace fclib {

template <class Cone>
VariationalInequality<Cone>::VariationalInequality(const ReducedProblem& problem, Metric metric)
    : problem_(problem), weight_(mean_diagonals(problem)) {
  const double largest = problem.nc() > 0 ? weight_.maxCoeff() : 0.0;
  for (double& w : weight_) {
    if (metric == Metric::uniform || !(w > tiny * largest)) w = largest;
    w = w > 0 ? 1 / w : 1.0;
  }
  largest_diagonal_ = largest;
}

template <class Cone>
VelocityPoint VariationalInequality<Cone>::point(const Vector& r) const {
  return {r, Vector::Zero(r.size()), Vector::Zero(r.size())};
}

template <class Cone>
void VariationalInequality<Cone>::evaluate(VelocityPoint& at) const {
  problem_.W.multiply_add(at.r, problem_.q, at.u);
  modify(at);
}

template <class Cone>
void VariationalInequality<Cone>::modify(VelocityPoint& at) const {
  for (Index a = 0; a < problem_.nc(); ++a) {
    at.hat.segment<D>(D * a) = cone(a).modified(at.u.segment<D>(D * a));
  }
}

template <class Cone>
void VariationalInequality<Cone>::project(const Vector& from, double rho, const Vector& direction,
                                          VelocityPoint& to) const {
  for (Index a = 0; a < problem_.nc(); ++a) {
    to.r.segment<D>(D * a) =
        cone(a).project(from.segment<D>(D * a) - rho * weight_[a] * direction.segment<D>(D * a));
  }
}

template <class Cone>
double VariationalInequality<Cone>::error(const VelocityPoint& at) const {
  const double error = relative_error<Cone>(problem_, at.u, at.r);
  const double rounding = std::numeric_limits<double>::epsilon() * largest_diagonal_ * at.r.norm();
  return rounding > swamped * problem_.scale ? std::max(error, rounding / problem_.scale) : error;
}

template <class Cone>
double VariationalInequality<Cone>::ratio(StepRatio which, const VelocityPoint& a,
                                          const VelocityPoint& b) const {
  double distance = 0;  // ||a - b||^2
  double slope = 0;     // ||F(a) - F(b)||^2
  double product = 0;   // (a - b) . (F(a) - F(b))
  for (Index k = 0; k < problem_.nc(); ++k) {
    const Vec r = a.r.segment<D>(D * k) - b.r.segment<D>(D * k);
    const Vec f = a.hat.segment<D>(D * k) - b.hat.segment<D>(D * k);
    distance += r.squaredNorm() / weight_[k];
    slope += f.squaredNorm() * weight_[k];
    product += r.dot(f);
  }
  if (!(distance > 0)) return 0.0;
  return which == StepRatio::khobotov ? std::sqrt(slope / distance) : product / distance;
}

template <class Cone>
double VariationalInequality<Cone>::distance_squared(const Vector& a, const Vector& b) const {
  double sum = 0;
  for (Index k = 0; k < problem_.nc(); ++k) {
    sum += (a - b).template segment<D>(D * k).squaredNorm() / weight_[k];
  }
  return sum;
}

template <class Cone>
double VariationalInequality<Cone>::velocity_squared(const Vector& f) const {
  double sum = 0;
  for (Index k = 0; k < problem_.nc(); ++k) {
    sum += f.template segment<D>(D * k).squaredNorm() * weight_[k];
  }
  return sum;
}

template <class Cone>
double VariationalInequality<Cone>::largest_eigenvalue() const {
  constexpr int max_products = 30;
  constexpr double accuracy = 1e-2;
  const Eigen::Index m = problem_.m();
  const Vector zero = Vector::Zero(m);
  Vector x(m);
  Vector y(m);
  // any start with a part along the first eigenvector: here no two entries are equal
  for (Eigen::Index k = 0; k < m; ++k) x[k] = 1 + 0.5 * std::sin(static_cast<double>(k + 1));
  double value = 0;
  for (int k = 0; k < max_products; ++k) {
    const double norm = std::sqrt(distance_squared(x, zero));
    if (!(norm > 0)) break;
    x /= norm;
    problem_.W.multiply_add(x, zero, y);
    const double last = value;
    value = std::sqrt(velocity_squared(y));
    if (std::abs(value - last) <= accuracy * value) break;
    for (Index a = 0; a < problem_.nc(); ++a) {
      x.segment<D>(D * a) = weight_[a] * y.segment<D>(D * a);
    }
  }
  return value > 0 && std::isfinite(value) ? value : 1.0;
}

#define FCLIB_INSTANTIATE(Cone) template class VariationalInequality<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
