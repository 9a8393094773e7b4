// The steps of ADMM for
//
//   min 1/2 x.W x + (q + s e_N).x + indicator(z in C),   x = z
//
// with the scaled multiplier w and a penalty rho weight^a for each contact:
//
//   x = (W + rho weight)^-1 (rho weight (z - w) - q - s)
//   z = P_C(alpha x + (1 - alpha) z + w),   w = w + alpha x + (1 - alpha) z - z+
//
// -rho weight w tends to the velocity u + s, so s may follow it. Each rho takes one factorisation,
// on the contacts or on the bodies, whichever is cheaper (CoupledSystem with D = 1 / (rho weight)).
//
// Boyd, Parikh, Chu, Peleato, Eckstein, "Distributed optimization and statistical learning via the
// alternating direction method of multipliers" (2011); Goldstein, O'Donoghue, Setzer, Baraniuk,
// "Fast alternating direction optimization methods" (2014), for acceleration with restart; Xu,
// Figueiredo, Goldstein, "Adaptive ADMM with spectral penalty parameter selection" (2017).
#pragma once

#include <cstdint>

#include "contact/cones.hpp"
#include "systems/coupled_system.hpp"

namespace fclib {

enum class PenaltyRule { constant, balance, spectral };

struct AlternatingDirectionsRules {
  double rho = 1;           ///< penalty at first, relative to the contacts' weights
  double relaxation = 1.6;  ///< alpha
  PenaltyRule penalty = PenaltyRule::spectral;
  bool accelerate = false;
  double eta = 0.999;         ///< if the combined residual falls by this factor, momentum is kept
  std::int64_t interval = 5;  ///< iterations between changes of rho, at first
};

template <class Cone>
class AlternatingDirections {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;

  /// Keeps references to the problem and to its system.
  AlternatingDirections(const ReducedProblem& problem, CoupledSystem& system,
                        AlternatingDirectionsRules rules, bool weighted = true);

  /// From r. The multiplier is the velocity of r with the shift. Returns false if W is not finite.
  bool start(const Vector& r, const Vector& u, const Vector& shift);

  [[nodiscard]] const Vector& z() const { return z_; }

  /// The velocity that the multiplier stands for, u + s.
  void velocity(Vector& u) const;

  void x_update(const Vector& shift);

  template <class Set>
  void z_update(const Set& set);

  void w_update();

  /// Changes rho if a change is due and worth its cost. Returns false if the factorisation failed.
  bool adapt();

 private:
  bool set_rho(double rho);

  [[nodiscard]] double squared(const Vector& v) const;
  [[nodiscard]] double squared_distance(const Vector& v, const Vector& w) const;

  void measure();

  void extrapolate();

  /// The penalty for which both residuals, each relative to its size, would be equal.
  [[nodiscard]] double balanced() const;

  /// rho weight^(1/2) w, and the gradient of the quadratic at x, in the metric with weights 1.
  void duals();
  void remember();

  /// A curvature from the changes of a variable and of its dual, and how well the two agree.
  [[nodiscard]] std::pair<double, double> curvature(const Vector& p, const Vector& p0,
                                                    const Vector& l, const Vector& l0) const;

  [[nodiscard]] double spectral();

  const ReducedProblem& problem_;
  AlternatingDirectionsRules rules_;
  CoupledSystem& system_;
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
  Vector dual_hat_, x0_, z0_, dual0_, dual_hat0_;  // for the spectral rule
};

#define FCLIB_DECLARE(Cone) extern template class AlternatingDirections<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
