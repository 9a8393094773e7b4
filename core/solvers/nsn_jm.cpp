// NSN-JM: nonsmooth Newton on the function of Jean & Moreau.
//
//   F(u, r) = r - [max(z_N, 0), P(z_T)],   z = r - rho u,   P on the disk of radius mu max(r_N, 0)
//   (B + A W) dr = -F,   A = dF/du, B = dF/dr,   r <- r + t dr
//
// t = 1, or from a line search on 1/2 ||F||^2 (methods/semismooth_newton.hpp; F in
// contact/contact_functions.hpp).
//
// Jean & Moreau, "Dynamics in the presence of unilateral contacts and dry friction" (1987);
// Christensen, Klarbring, Pang & Stromberg, "Formulation and comparison of algorithms for
// frictional contact problems" (1998); Acary, Bremond, Huber, "On solving contact problems with
// Coulomb friction: formulations and numerical comparisons" (2018).
//
// Differs from the papers in: at kinks, the element of the generalised Jacobian is that of the side
// on which a contact is open or sticks. W + delta I replaces W in the system, and delta goes to
// zero with the error: with a singular W alone, Newton's method wanders. In a line search, if
// Newton's step is no descent, the search goes along minus the gradient (W symmetric). If the error
// does not fall any more, Newton starts again after sweeps of nonsmooth Gauss-Seidel (sweeps = 0:
// it ends).
//
// Nothing makes it converge from far away: expect `stalled` or a limit on some packings. The system
// is factorised on the contacts, however few the bodies are.

#include "methods/newton_loop.hpp"

namespace fclib::nsn_jm {

const Solver& solver() {
  static const Solver entry = newton_entry("nsn-jm", "Nonsmooth Newton, Jean and Moreau",
                                           "Jean & Moreau 1987; Christensen et al. 1998", {3, 5},
                                           ContactFunctionKind::jean_moreau);
  return entry;
}

}  // namespace fclib::nsn_jm
