// NSN-NM: nonsmooth Newton on the natural map.
//
//   F(u, r) = r - P_K(r - rho u^),   u^ = u + [mu ||u_T||, 0, 0]
//   (B + A W) dr = -F,   A = dF/du, B = dF/dr,   r <- r + t dr
//
// t = 1, or from a line search on 1/2 ||F||^2 (methods/semismooth_newton.hpp; F in
// contact/contact_functions.hpp).
//
// De Saxce & Feng, "The bipotential method" (1998); Acary, Bremond, Huber, "On solving contact
// problems with Coulomb friction: formulations and numerical comparisons" (2018).
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

namespace fclib::nsn_nm {

const Solver& solver() {
  static const Solver entry =
      newton_entry("nsn-nm", "Nonsmooth Newton, natural map", "De Saxce & Feng 1998", {3, 5},
                   ContactFunctionKind::natural_map);
  return entry;
}

}  // namespace fclib::nsn_nm
