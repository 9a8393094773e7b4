// FP-VI-UPK: fixed-point projections on the variational inequality, with the step rule of Khobotov.
//
//   repeat  z <- P_K(z_k - rho F(z_k)),  F(r) = u^, u = W r + q
//   until   rho ||F(z) - F(z_k)|| <= L ||z - z_k||, else rho <- tau rho
//   z_k+1 = z;  rho <- rho / tau if it holds with L_min for L
//
// Khobotov, "Modification of the extra-gradient method for solving variational inequalities and
// certain optimization problems" (1987), as Marcotte (1991) and He & Liao (2002) use it;
// algorithms 1 and 3 of Acary, Bremond, Huber, "On solving contact problems with Coulomb friction:
// formulations and numerical comparisons" (2018).
//
// The loop, and what differs from the paper: methods/projection_loops.hpp.

#include "methods/projection_loops.hpp"

namespace fclib::fp_vi_upk {

const Solver& solver() {
  static const Solver entry = projection_entry<StepOptions>(
      "fp-vi-upk", "Fixed-point projection, step rule of Khobotov", "Khobotov 1987",
      [](const ReducedProblem& problem, const auto& options, Iterates& iterates,
         const Vector& start) {
        return fixed_point(StepRatio::khobotov, problem, options, iterates, start);
      });
  return entry;
}

}  // namespace fclib::fp_vi_upk
