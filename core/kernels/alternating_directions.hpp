// The steps of ADMM for
//
//   min 1/2 x.W x + (q + s e_N).x + indicator(z in C),   x = z
//
// with the scaled multiplier w and a penalty rho weight^a for each contact:
//
//   x = (W + rho weight)^-1 (rho weight (z - w) - q - s)
//   z = P_C(alpha x + (1 - alpha) z + w),   w = w + alpha x + (1 - alpha) z - z+
//
// -rho weight w tends to the velocity u + s, so s may follow it. One factorisation for each rho, on
// the contacts or on the bodies, whichever is cheaper (CoupledSystem with D = 1 / (rho weight)).
//
// Boyd, Parikh, Chu, Peleato, Eckstein, "Distributed optimization and statistical learning via the
// alternating direction method of multipliers" (2011); Goldstein, O'Donoghue, Setzer, Baraniuk,
// "Fast alternating direction optimization methods" (2014), for acceleration with restart; Xu,
// Figueiredo, Goldstein, "Adaptive ADMM with spectral penalty parameter selection" (2017).
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "kernels/convex_sets.hpp"
#include "kernels/coupled_system.hpp"

namespace fclib {

enum class PenaltyRule { constant, balance, spectral };

struct AlternatingDirectionsRules {
  double rho = 1;           ///< penalty at first, relative to the contacts' weights
  double relaxation = 1.6;  ///< alpha
  PenaltyRule penalty = PenaltyRule::spectral;
  bool accelerate = false;
  double eta = 0.999;         ///< share of the combined residual under which momentum is kept
  std::int64_t interval = 5;  ///< iterations between changes of rho, at first
};

template <class Cone>
class AlternatingDirections {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;

  AlternatingDirections(const Delassus& problem, AlternatingDirectionsRules rules,
                        bool weighted = true)
      : problem_(problem), rules_(rules), system_(problem), weight_(contact_weights(problem)) {
    if (!weighted) weight_.setConstant(problem.nc() > 0 ? weight_.mean() : 1.0);
    due_ = rules.interval;
    for (Index a = 0; a < problem.nc(); ++a)
      size_q_ += problem.q.template segment<D>(D * a).squaredNorm() / weight_[a];
    size_q_ = std::sqrt(size_q_);
    for (Vector* v : {&x_, &relaxed_, &w_, &z_, &zh_, &wh_, &old_z_, &old_w_, &dual_hat_})
      v->setZero(problem.m());
    for (Vector* v : {&x0_, &z0_, &dual0_, &dual_hat0_}) v->setZero(problem.m());
  }

  /// From r, whose velocity with the shift is the multiplier. False where W is not finite.
  bool start(const Vector& r, const Vector& u, const Vector& shift) {
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

  [[nodiscard]] const Vector& z() const { return z_; }

  /// The velocity that the multiplier stands for, u + s.
  void velocity(Vector& u) const {
    for (Index a = 0; a < problem_.nc(); ++a) {
      u.template segment<D>(D * a) = -rho_ * weight_[a] * w_.template segment<D>(D * a);
    }
  }

  void x_update(const Vector& shift) {
    for (Index a = 0; a < problem_.nc(); ++a) {
      Vec h = problem_.q.template segment<D>(D * a);
      h[0] += shift[a];
      x_.template segment<D>(D * a) =
          zh_.template segment<D>(D * a) - wh_.template segment<D>(D * a) - h / (rho_ * weight_[a]);
    }
    system_.solve_plain(x_);
  }

  template <class Set>
  void z_update(const Set& set) {
    old_z_.swap(z_);
    for (Index a = 0; a < problem_.nc(); ++a) {
      const Vec zh = zh_.template segment<D>(D * a);
      const Vec relaxed =
          rules_.relaxation * x_.template segment<D>(D * a) + (1 - rules_.relaxation) * zh;
      relaxed_.template segment<D>(D * a) = relaxed;
      z_.template segment<D>(D * a) = set.project(a, relaxed + wh_.template segment<D>(D * a), zh);
    }
  }

  void w_update() {
    old_w_.swap(w_);
    w_ = wh_ + relaxed_ - z_;
    measure();
    extrapolate();
  }

  /// Changes rho where it is due and pays. False where the factorisation failed.
  bool adapt() {
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

 private:
  bool set_rho(double rho) {
    rho_ = std::clamp(rho, 1e-8, 1e8);
    std::vector<double>& blocks = system_.blocks();
    for (Index a = 0; a < problem_.nc(); ++a) {
      Eigen::Map<ContactMatrix<D>>(blocks.data() + std::ptrdiff_t{D * D} * a) =
          ContactMatrix<D>::Identity() / (rho_ * weight_[a]);
    }
    return system_.factorise();
  }

  [[nodiscard]] double squared(const Vector& v) const {
    double sum = 0;
    for (Index a = 0; a < problem_.nc(); ++a)
      sum += weight_[a] * v.template segment<D>(D * a).squaredNorm();
    return sum;
  }
  [[nodiscard]] double squared_distance(const Vector& v, const Vector& w) const {
    double sum = 0;
    for (Index a = 0; a < problem_.nc(); ++a)
      sum +=
          weight_[a] * (v.template segment<D>(D * a) - w.template segment<D>(D * a)).squaredNorm();
    return sum;
  }

  void measure() {
    const double size = std::sqrt(std::max(squared(x_), squared(z_)));
    // the velocities may well tend to zero: q is part of their size
    const double velocity = std::max(rho_ * std::sqrt(squared(w_)), size_q_);
    primal_ = std::sqrt(squared_distance(x_, z_)) / (size > 0 ? size : 1.0);
    dual_ = rho_ * std::sqrt(squared_distance(z_, old_z_)) / (velocity > 0 ? velocity : 1.0);
  }

  void extrapolate() {
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

  /// The penalty at which both residuals, each relative to its size, would be the same.
  [[nodiscard]] double balanced() const {
    if (!(primal_ > 0 && dual_ > 0)) return rho_;
    return rho_ * std::sqrt(primal_ / dual_);
  }

  /// rho weight^(1/2) w, and the slope of the quadratic at x, in the metric where weights are 1.
  void duals() {
    for (Index a = 0; a < problem_.nc(); ++a) {
      const auto w = w_.template segment<D>(D * a);
      const auto step = x_.template segment<D>(D * a) - old_z_.template segment<D>(D * a);
      dual_hat_.template segment<D>(D * a) = -rho_ * (old_w_.template segment<D>(D * a) + step);
      relaxed_.template segment<D>(D * a) = -rho_ * w;  // scratch until the next z_update
    }
  }
  void remember() {
    if (rules_.penalty != PenaltyRule::spectral) return;
    duals();
    x0_ = x_;
    z0_ = z_;
    dual_hat0_ = dual_hat_;
    dual0_ = relaxed_;
  }

  /// A curvature from the change of a variable and of its dual, and how far they agree.
  [[nodiscard]] std::pair<double, double> curvature(const Vector& p, const Vector& p0,
                                                    const Vector& l, const Vector& l0) const {
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

  [[nodiscard]] double spectral() {
    constexpr double agreement = 0.2;
    duals();
    const auto [alpha, alpha_sure] = curvature(x_, x0_, dual_hat_, dual_hat0_);
    auto [beta, beta_sure] = curvature(z_, z0_, dual0_, relaxed_);
    if (alpha_sure > agreement && beta_sure > agreement) return std::sqrt(alpha * beta);
    if (alpha_sure > agreement) return alpha;
    if (beta_sure > agreement) return beta;
    return rho_;
  }

  const Delassus& problem_;
  AlternatingDirectionsRules rules_;
  CoupledSystem system_;
  Vector weight_;
  double rho_ = 0;
  double theta_ = 1;
  double combined_ = std::numeric_limits<double>::infinity();
  double size_q_ = 0;
  double primal_ = 0;  // ||x - z|| and rho ||z - z_old||, each relative to its size
  double dual_ = 0;
  std::int64_t since_ = 0;
  std::int64_t due_ = 5;
  Vector x_, z_, w_, relaxed_, zh_, wh_, old_z_, old_w_;
  Vector dual_hat_, x0_, z0_, dual0_, dual_hat0_;  // of the spectral rule
};

}  // namespace fclib
