// FP-VI-UPTS: fixed-point projections on the variational inequality, with the step rule of Solodov
// & Tseng.
//
//   repeat  z <- P_K(z_k - rho F(z_k)),  F(r) = u^, u = W r + q
//   until   rho (z - z_k) . (F(z) - F(z_k)) <= L ||z - z_k||^2, else rho <- tau rho
//   z_k+1 = z;  rho <- rho / tau if it holds with L_min for L
//
// Solodov & Tseng, "Modified projection-type methods for monotone variational inequalities" (1996);
// algorithms 1 and 3 of Acary, Bremond, Huber, "On solving contact problems with Coulomb friction:
// formulations and numerical comparisons" (2018).
//
// The loop, and what differs from the paper: methods/projection_loops.hpp.

#include "methods/projection_loops.hpp"

namespace fclib::fp_vi_upts {

const Solver& solver() {
  static const Solver entry = projection_entry<StepOptions>(
      "fp-vi-upts", "Fixed-point projection, step rule of Solodov & Tseng", "Solodov & Tseng 1996",
      [](const ReducedProblem& problem, const auto& options, Iterates& iterates,
         const Vector& start) {
        return fixed_point(StepRatio::solodov_tseng, problem, options, iterates, start);
      });
  return entry;
}

}  // namespace fclib::fp_vi_upts
