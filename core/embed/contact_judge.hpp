// The merit's error of a solution, from the velocities of its contacts, in extended precision.
#pragma once

#include <cmath>

#include "contact/coulomb.hpp"
#include "linalg/extended.hpp"
#include "merit/natural_sums.hpp"

namespace fclib {

/// `size(a)` is the mean |W_kk| of contact a, `velocity(a)` its W r + q and `free(a)` its q. Where
/// q is given, this is Merit::error; if it is condensed, its rounding counts as an error, so
/// that this is no less.
template <int D, class Size, class Velocity, class Free>
double contact_error(std::int64_t nc, const double* mu, const double* r, const Size& size,
                     const Velocity& velocity, const Free& free) {
  using std::sqrt;  // or that of Real
  using Vec = ContactVector<D, Real>;
  ContactScales<Real> scales;
  Real squares = 0;
  for (std::int64_t a = 0; a < nc; ++a) {
    scales.add(size(a));
    const Vec q = free(a);
    for (int k = 0; k < D; ++k) squares += q[k] * q[k];
  }
  const Real mean = sqrt(squares / static_cast<double>(nc));
  NaturalSums<Coulomb<D, Real>> sums;
  for (std::int64_t a = 0; a < nc; ++a) {
    const Vec u = velocity(a);
    const Vec q = free(a);
    Vec ra;
    for (int k = 0; k < D; ++k) ra[k] = r[D * a + k];
    const Coulomb<D, Real> cone(mu[a]);
    const Real q_square = q.squaredNorm();
    const Real slip = slip_of_rounding<Real>(sqrt(q_square), mean);
    sums.add(cone, u, ra, q_square, Real(0), scales.rho(size(a)), {slip});
  }
  return sums.error();
}

}  // namespace fclib
