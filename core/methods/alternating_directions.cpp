#include "methods/alternating_directions.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "reduced/convex_sets.hpp"
#include "reduced/scale.hpp"

namespace fclib {

template <class Cone>
AlternatingDirections<Cone>::AlternatingDirections(const ReducedProblem& problem,
                                                   CoupledSystem& system,
                                                   AlternatingDirectionsRules rules, bool weighted)
    : problem_(problem), rules_(rules), system_(system), weight_(contact_weights(problem)) {
  if (!weighted) weight_.setConstant(problem.nc() > 0 ? weight_.mean() : 1.0);
  due_ = rules.interval;
  for (Index a = 0; a < problem.nc(); ++a)
    size_q_ += problem.q.template segment<D>(D * a).squaredNorm() / weight_[a];
  size_q_ = std::sqrt(size_q_);
  for (Vector* v : {&x_, &relaxed_, &w_, &z_, &zh_, &wh_, &old_z_, &old_w_, &dual_hat_})
    v->setZero(problem.m());
  for (Vector* v : {&x0_, &z0_, &dual0_, &dual_hat0_}) v->setZero(problem.m());
}

template <class Cone>
bool AlternatingDirections<Cone>::start(const Vector& r, const Vector& u, const Vector& shift) {
  z_ = r;
  if (rho_ == 0 && !set_rho(rules_.rho)) return false;
  for (Index a = 0; a < problem_.nc(); ++a) {
    auto w = w_.template segment<D>(D * a);
    w = u.template segment<D>(D * a);
    w[0] += shift[a];
    w /= -rho_ * weight_[a];
  }
  zh_ = z_;
  wh_ = w_;
  theta_ = 1;
  combined_ = std::numeric_limits<double>::infinity();
  remember();
  return true;
}

template <class Cone>
void AlternatingDirections<Cone>::velocity(Vector& u) const {
  for (Index a = 0; a < problem_.nc(); ++a) {
    u.template segment<D>(D * a) = -rho_ * weight_[a] * w_.template segment<D>(D * a);
  }
}

template <class Cone>
void AlternatingDirections<Cone>::x_update(const Vector& shift) {
  for (Index a = 0; a < problem_.nc(); ++a) {
    Vec h = problem_.q.template segment<D>(D * a);
    h[0] += shift[a];
    x_.template segment<D>(D * a) =
        zh_.template segment<D>(D * a) - wh_.template segment<D>(D * a) - h / (rho_ * weight_[a]);
  }
  system_.solve(x_, false);
}

template <class Cone>
template <class Set>
void AlternatingDirections<Cone>::z_update(const Set& set) {
  old_z_.swap(z_);
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Vec zh = zh_.template segment<D>(D * a);
    const Vec relaxed =
        rules_.relaxation * x_.template segment<D>(D * a) + (1 - rules_.relaxation) * zh;
    relaxed_.template segment<D>(D * a) = relaxed;
    z_.template segment<D>(D * a) = set.project(a, relaxed + wh_.template segment<D>(D * a), zh);
  }
}

template <class Cone>
void AlternatingDirections<Cone>::w_update() {
  old_w_.swap(w_);
  w_ = wh_ + relaxed_ - z_;
  measure();
  extrapolate();
}

template <class Cone>
bool AlternatingDirections<Cone>::adapt() {
  if (rules_.penalty == PenaltyRule::constant || ++since_ < due_) return true;
  since_ = 0;
  const double next = rules_.penalty == PenaltyRule::balance ? balanced() : spectral();
  remember();
  if (!(next > 3 * rho_ || next < rho_ / 3)) return true;
  due_ = std::min<std::int64_t>(2 * due_, 10000);
  const double old = rho_;
  if (!set_rho(std::clamp(next, old / 100, old * 100))) return false;
  w_ *= old / rho_;
  wh_ = w_;
  zh_ = z_;
  theta_ = 1;
  remember();
  return true;
}

template <class Cone>
bool AlternatingDirections<Cone>::set_rho(double rho) {
  rho_ = std::clamp(rho, 1e-8, 1e8);
  std::vector<double>& blocks = system_.blocks();
  for (Index a = 0; a < problem_.nc(); ++a) {
    Eigen::Map<ContactMatrix<D>>(blocks.data() + std::ptrdiff_t{D * D} * a) =
        ContactMatrix<D>::Identity() / (rho_ * weight_[a]);
  }
  return system_.factorise();
}

template <class Cone>
double AlternatingDirections<Cone>::squared(const Vector& v) const {
  double sum = 0;
  for (Index a = 0; a < problem_.nc(); ++a)
    sum += weight_[a] * v.template segment<D>(D * a).squaredNorm();
  return sum;
}

template <class Cone>
double AlternatingDirections<Cone>::squared_distance(const Vector& v, const Vector& w) const {
  double sum = 0;
  for (Index a = 0; a < problem_.nc(); ++a)
    sum += weight_[a] * (v.template segment<D>(D * a) - w.template segment<D>(D * a)).squaredNorm();
  return sum;
}

template <class Cone>
void AlternatingDirections<Cone>::measure() {
  const double size = std::sqrt(std::max(squared(x_), squared(z_)));
  // the velocities may tend to zero, so q is part of their size
  const double velocity = std::max(rho_ * std::sqrt(squared(w_)), size_q_);
  primal_ = std::sqrt(squared_distance(x_, z_)) / (size > 0 ? size : 1.0);
  dual_ = rho_ * std::sqrt(squared_distance(z_, old_z_)) / (velocity > 0 ? velocity : 1.0);
}

template <class Cone>
void AlternatingDirections<Cone>::extrapolate() {
  if (!rules_.accelerate) {
    zh_ = z_;
    wh_ = w_;
    return;
  }
  const double combined = squared_distance(w_, wh_) + squared_distance(z_, zh_);
  if (combined < rules_.eta * combined_) {
    const double grown = 0.5 * (1 + std::sqrt(1 + 4 * theta_ * theta_));
    const double beta = (theta_ - 1) / grown;
    zh_ = z_ + beta * (z_ - old_z_);
    wh_ = w_ + beta * (w_ - old_w_);
    theta_ = grown;
    combined_ = combined;
  } else {
    theta_ = 1;
    zh_ = z_;
    wh_ = w_;
    combined_ /= rules_.eta;
    if (!(combined_ < std::numeric_limits<double>::infinity())) combined_ = combined;
  }
}

template <class Cone>
double AlternatingDirections<Cone>::balanced() const {
  if (!(primal_ > 0 && dual_ > 0)) return rho_;
  return rho_ * std::sqrt(primal_ / dual_);
}

template <class Cone>
void AlternatingDirections<Cone>::duals() {
  for (Index a = 0; a < problem_.nc(); ++a) {
    const auto w = w_.template segment<D>(D * a);
    const auto step = x_.template segment<D>(D * a) - old_z_.template segment<D>(D * a);
    dual_hat_.template segment<D>(D * a) = -rho_ * (old_w_.template segment<D>(D * a) + step);
    relaxed_.template segment<D>(D * a) = -rho_ * w;  // scratch until the next z_update
  }
}

template <class Cone>
void AlternatingDirections<Cone>::remember() {
  if (rules_.penalty != PenaltyRule::spectral) return;
  duals();
  x0_ = x_;
  z0_ = z_;
  dual_hat0_ = dual_hat_;
  dual0_ = relaxed_;
}

template <class Cone>
std::pair<double, double> AlternatingDirections<Cone>::curvature(const Vector& p, const Vector& p0,
                                                                 const Vector& l,
                                                                 const Vector& l0) const {
  double pp = 0;
  double pl = 0;
  double ll = 0;
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Vec dp = p.template segment<D>(D * a) - p0.template segment<D>(D * a);
    const Vec dl = l.template segment<D>(D * a) - l0.template segment<D>(D * a);
    pp += weight_[a] * dp.squaredNorm();
    pl += weight_[a] * dp.dot(dl);
    ll += weight_[a] * dl.squaredNorm();
  }
  if (!(pp > 0 && ll > 0 && pl > 0)) return {0, 0};
  const double steepest = ll / pl;
  const double least = pl / pp;
  return {2 * least > steepest ? least : steepest - 0.5 * least, pl / std::sqrt(pp * ll)};
}

template <class Cone>
double AlternatingDirections<Cone>::spectral() {
  constexpr double agreement = 0.2;
  duals();
  const auto [alpha, alpha_sure] = curvature(x_, x0_, dual_hat_, dual_hat0_);
  auto [beta, beta_sure] = curvature(z_, z0_, dual0_, relaxed_);
  if (alpha_sure > agreement && beta_sure > agreement) return std::sqrt(alpha * beta);
  if (alpha_sure > agreement) return alpha;
  if (beta_sure > agreement) return beta;
  return rho_;
}

#define FCLIB_INSTANTIATE(Cone)                                            \
  template class AlternatingDirections<Cone>;                              \
  template void AlternatingDirections<Cone>::z_update(const Cones<Cone>&); \
  template void AlternatingDirections<Cone>::z_update(const Cylinders<Cone>&);
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
