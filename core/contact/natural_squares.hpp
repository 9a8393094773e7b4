// The natural map of many contacts, summed in the three ways that the errors need.
#pragma once

#include <algorithm>
#include <cmath>

#include "contact/cone.hpp"
#include "error_size.hpp"

namespace fclib {

/// Sums over contacts of the natural map F = r - P_K(r - u^), and of F with rho u^.
///
/// The map with rho is summed twice. As impulses, a light body counts for nothing beside a heavy
/// one. As velocities, a slow one counts for nothing beside a fast one. Two bodies that penetrate
/// are found by u_N: if mu is large, mu ||u_T|| in u^ brings u^ into K* up to 1 / mu of the
/// velocity at which they penetrate.
template <class Real>
struct NaturalSquares {
  Real plain = 0;       ///< sum of ||F||^2
  Real impulses = 0;    ///< sum of ||F_rho||^2
  Real velocities = 0;  ///< sum of max(||F_rho|| / rho, -u_N)^2

  template <class Cone>
  void add_plain(const Cone& cone, const typename Cone::Vec& u, const typename Cone::Vec& r) {
    plain += natural_map(cone, u, r).squaredNorm();
  }

  template <class Cone>
  void add_scaled(const Cone& cone, const typename Cone::Vec& u, const typename Cone::Vec& r,
                  Real rho) {
    const Real square = natural_map(cone, u, r, rho).squaredNorm();
    impulses += square;
    velocities += std::max(square / (rho * rho), u[0] < 0 ? u[0] * u[0] : Real(0));
  }

  /// The error if ||q|| is `scale` and ||rho q|| is `scaled_scale`.
  [[nodiscard]] double error(Real scale, Real scaled_scale) const {
    using std::sqrt;
    const double plainly = larger_error(sqrt(velocities) / scale, sqrt(plain) / scale);
    return larger_error(plainly, sqrt(impulses) / scaled_scale);
  }
};

}  // namespace fclib
