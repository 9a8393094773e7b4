// NSN-AC: nonsmooth Newton on the function of Alart & Curnier.
//
//   F(u, r) = r - [max(z_N, 0), P(z_T)],   z = r - rho u,   P on the disk of radius mu max(z_N, 0)
//   (B + A W) dr = -F,   A = dF/du, B = dF/dr,   r <- r + t dr
//
// t = 1, or from a line search on 1/2 ||F||^2 (methods/semismooth_newton.hpp; F in
// contact/contact_functions.hpp).
//
// Alart & Curnier, "A mixed formulation for frictional contact problems prone to Newton like
// solution methods" (1991); section 5.1 of Acary, Bremond, Huber, "On solving contact problems with
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

namespace fclib::nsn_ac {

const Solver& solver() {
  static const Solver entry = [] {
    Solver result =
        newton_entry("nsn-ac", "Nonsmooth Newton, Alart and Curnier", "Alart & Curnier 1991",
                     {3, 5}, ContactFunctionKind::alart_curnier);
    result.spin_dimensions = {4, 6};
    return result;
  }();
  return entry;
}

}  // namespace fclib::nsn_ac
