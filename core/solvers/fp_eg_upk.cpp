// FP-EG-UPK: extragradient projections on the variational inequality, with the step rule of
// Khobotov.
//
//   repeat  z <- P_K(z_k - rho F(z_k)),  F(r) = u^, u = W r + q
//   until   rho ||F(z) - F(z_k)|| <= L ||z - z_k||, else rho <- tau rho
//   z_k+1 = P_K(z - rho F(z));  rho <- rho / tau if it holds with L_min for L
//
// The second projection starts at the trial point z, so an iteration is two gradient steps of the
// same length. Korpelevich and the paper have P_K(z_k - rho F(z)): this is the option `second` =
// start. It is proved for more problems, and slower on nearly all.
//
// Korpelevich, "The extragradient method for finding saddle points and other problems" (1976);
// Khobotov, "Modification of the extra-gradient method for solving variational inequalities and
// certain optimization problems" (1987), as Marcotte (1991) and He & Liao (2002) use it;
// algorithms 2 and 3 of Acary, Bremond, Huber, "On solving contact problems with Coulomb friction:
// formulations and numerical comparisons" (2018).
//
// The loop, and what differs from the paper: methods/projection_loops.hpp.

#include "methods/projection_loops.hpp"

namespace fclib::fp_eg_upk {

const Solver& solver() {
  static const Solver entry = projection_entry<ExtragradientOptions>(
      "fp-eg-upk", "Extragradient projection, step rule of Khobotov",
      "Korpelevich 1976; Khobotov 1987",
      [](const ReducedProblem& problem, const auto& options, Iterates& iterates,
         const Vector& start) {
        return extragradient(StepRatio::khobotov, problem, options, iterates, start);
      });
  return entry;
}

}  // namespace fclib::fp_eg_upk
