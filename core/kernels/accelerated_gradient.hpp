// One step of Nesterov's accelerated projected gradient method for
//
//   min 1/2 r.W r + (q + s e_N).r,   r in a product of convex sets
//
// in the metric of the contacts' weights:
//
//   x+ = P(y - t (W y + q + s) / weight),  t small enough for (x+ - y).W (x+ - y) <= |x+ - y|^2 / t
//   y+ = x+ + beta (x+ - x),  started afresh where (W y + q + s).(x+ - x) > 0
//
// The test on t does not depend on s, which may change at each step. One product with W a step.
//
// Nesterov 1983; O'Donoghue & Candes, "Adaptive restart for accelerated gradient schemes" (2015);
// Mazhar, Heyn, Negrut, Tasora, "Using Nesterov's method to accelerate multibody dynamics with
// friction and contact" (2015).
#pragma once

#include "kernels/convex_sets.hpp"

namespace fclib {

struct AcceleratedGradientRules {
  double growth = 1.05;    ///< of t after an accepted step
  double reduction = 0.7;  ///< of t at most, where it was too long
  bool restart = true;     ///< start the momentum afresh where it goes uphill
};

template <class Cone>
class AcceleratedGradient {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;

  AcceleratedGradient(const Delassus& problem, AcceleratedGradientRules rules, bool weighted = true)
      : problem_(problem), rules_(rules), weight_(contact_weights(problem)) {
    if (!weighted) weight_.setConstant(problem.nc() > 0 ? weight_.mean() : 1.0);
  }

  /// From x with u = W x + q; forgets the momentum.
  void start(const Vector& x, const Vector& u) {
    x_ = y_ = x;
    u_ = uy_ = u;
    next_ = x;
    next_u_ = u;
    theta_ = 1;
  }

  [[nodiscard]] const Vector& x() const { return x_; }
  [[nodiscard]] const Vector& u() const { return u_; }    ///< W x + q
  [[nodiscard]] const Vector& uy() const { return uy_; }  ///< W y + q, where the slope is taken

  template <class Set>
  void step(const Set& set, const Vector& shift) {
    for (int attempt = 0; attempt < 60; ++attempt) {
      double slope_change = 0;
      double length = 0;
      uphill_ = 0;
      for (Index a = 0; a < problem_.nc(); ++a) {
        Vec slope = uy_.template segment<D>(D * a);
        slope[0] += shift[a];
        const Vec y = y_.template segment<D>(D * a);
        const Vec next = set.project(a, y - (t_ / weight_[a]) * slope, y);
        next_.template segment<D>(D * a) = next;
        length += weight_[a] * (next - y).squaredNorm();
        uphill_ += slope.dot(next - x_.template segment<D>(D * a));
      }
      problem_.velocity(next_, next_u_);
      slope_change = (next_ - y_).dot(next_u_ - uy_);
      if (!(t_ * slope_change > length)) break;
      t_ = std::clamp(0.95 * length / slope_change, 0.1 * t_, rules_.reduction * t_);
    }
    const double grown = 0.5 * (1 + std::sqrt(1 + 4 * theta_ * theta_));
    double beta = (theta_ - 1) / grown;
    theta_ = grown;
    if (rules_.restart && uphill_ > 0) {
      theta_ = 1;
      beta = 0;
    }
    y_ = next_ + beta * (next_ - x_);
    uy_ = next_u_ + beta * (next_u_ - u_);
    x_.swap(next_);
    u_.swap(next_u_);
    t_ *= rules_.growth;
  }

 private:
  const Delassus& problem_;
  AcceleratedGradientRules rules_;
  Vector weight_;
  double t_ = 1;  // step, relative to 1 / weight
  double theta_ = 1;
  double uphill_ = 0;
  Vector x_, u_, y_, uy_, next_, next_u_;
};

}  // namespace fclib
