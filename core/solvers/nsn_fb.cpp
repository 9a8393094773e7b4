// NSN-FB: nonsmooth Newton on the function of Fischer & Burmeister for
// the second-order cone.
//
//   F(u, r) = x + y - (x o x + y o y)^(1/2),   x = (mu r_N, r_T),   y = rho (u^_N / mu, u_T)
//   (B + A W) dr = -F,   A = dF/du, B = dF/dr,   r <- r + t dr
//
// t = 1, or from a line search on 1/2 ||F||^2 (methods/semismooth_newton.hpp; F in
// contact/contact_functions.hpp).
//
// Fukushima, Luo & Tseng, "Smoothing functions for second-order-cone complementarity problems"
// (2001); Acary, Bremond, Huber, "On solving contact problems with Coulomb friction: formulations
// and numerical comparisons" (2018).
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

namespace fclib::nsn_fb {

const Solver& solver() {
  static const Solver entry =
      newton_entry("nsn-fb", "Nonsmooth Newton, Fischer and Burmeister",
                   "Fukushima, Luo & Tseng 2001", {}, ContactFunctionKind::fischer_burmeister);
  return entry;
}

}  // namespace fclib::nsn_fb
