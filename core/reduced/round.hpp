// A problem whose sliding and spin share an ellipsoid, as one of a round cone of dimension 4.
//
//   r = E r~,  u~ = E u,  W~ = E W E,  q~ = E q,   E = diag(1, 1, 1, mu_s / mu)
//
// turns (||r_T|| / mu)^2 + (r_S / mu_s)^2 <= r_N^2 into ||(r~_T, r~_S)|| <= mu r~_N, the cone of
// Coulomb with three tangential components, and de Saxce's term into mu ||(u~_T, u~_S)||. So every
// method of that cone takes it. A contact that slides freely and resists spin has E = diag(1, 0, 0,
// mu_s) and the coefficient 1. If an entry of E is 0, the component is not moved: it gets a mass of
// its own in W~, so that it is 0 and no block is singular.
#pragma once

#include "reduced/reduced_problem.hpp"

namespace fclib {

class Round {
 public:
  /// `W` is that of the problem, whose friction is coupled. `given` must outlive this.
  Round(const Matrix& W, const ReducedProblem& given);

  [[nodiscard]] const ReducedProblem& problem() const { return problem_; }
  /// r~ of r (m); a component that E takes away is 0.
  [[nodiscard]] Vector to_own(const Vector& r) const;
  /// r of r~ (m).
  [[nodiscard]] Vector reactions(const Vector& r) const { return scale_.cwiseProduct(r); }

 private:
  Vector scale_;  // E (m)
  Primal primal_;
  ReducedProblem problem_;
};

}  // namespace fclib
