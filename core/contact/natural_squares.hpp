// The natural map of many contacts summed up in the three ways that errors are made of.
#pragma once

#include <algorithm>
#include <cmath>

#include "contact/cone.hpp"
#include "error_size.hpp"

namespace fclib {

/// Of the natural map F = r - P_K(r - u^), and of F with rho u^, of contacts that are added.
///
/// With rho it is summed as impulses and as velocities: beside a heavy body the impulses of a light
/// one vanish, whatever it does, and beside a fast one the velocities of a slow one. Two bodies
/// that penetrate are told as such: with a large mu their u^, which has mu ||u_T|| in it, is in K*
/// all but for 1 / mu of the velocity at which they do.
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
