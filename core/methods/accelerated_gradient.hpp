// One step of Nesterov's accelerated projected gradient method for
//
//   min 1/2 r.W r + (q + s e_N).r,   r in a product of convex sets
//
// in the metric of the contacts' weights:
//
//   x+ = P(y - t (W y + q + s) / weight),  t small enough for (x+ - y).W (x+ - y) <= |x+ - y|^2 / t
//   y+ = x+ + beta (x+ - x),  restarted if (W y + q + s).(x+ - x) > 0
//
// The test on t does not depend on s, so s may change at each step. One step takes one product with
// W.
//
// Nesterov 1983; O'Donoghue & Candes, "Adaptive restart for accelerated gradient schemes" (2015);
// Mazhar, Heyn, Negrut, Tasora, "Using Nesterov's method to accelerate multibody dynamics with
// friction and contact" (2015).
#pragma once

#include "contact/cones.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

struct AcceleratedGradientRules {
  double growth = 1.05;    ///< of t after an accepted step
  double reduction = 0.7;  ///< largest factor on t after it was too long
  bool restart = true;     ///< restart the momentum if the objective rises
};

template <class Cone>
class AcceleratedGradient {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;

  AcceleratedGradient(const ReducedProblem& problem, AcceleratedGradientRules rules,
                      bool weighted = true);

  /// From x with u = W x + q; forgets the momentum.
  void start(const Vector& x, const Vector& u);

  [[nodiscard]] const Vector& x() const { return x_; }
  [[nodiscard]] const Vector& u() const { return u_; }    ///< W x + q
  [[nodiscard]] const Vector& uy() const { return uy_; }  ///< W y + q: the gradient is taken at y

  template <class Set>
  void step(const Set& set, const Vector& shift);

 private:
  const ReducedProblem& problem_;
  AcceleratedGradientRules rules_;
  Vector weight_;
  double t_ = 1;  // step, relative to 1 / weight
  double theta_ = 1;
  double uphill_ = 0;
  Vector x_, u_, y_, uy_, next_, next_u_;
};

#define FCLIB_DECLARE(Cone) extern template class AcceleratedGradient<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
