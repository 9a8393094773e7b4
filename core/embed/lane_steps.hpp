// The arithmetic of a contact in each lane of a vector. `Wide` is an array of Eigen, or has the
// same functions. All are compiled into what calls them, for its processor; FCLIB_IN_LANES says
// how, if that is not as usual.
#pragma once

#ifndef FCLIB_IN_LANES
#include <Eigen/Core>
#define FCLIB_IN_LANES EIGEN_ALWAYS_INLINE
#endif

namespace fclib {

/// Instead of 0 in a denominator.
inline constexpr double least_denominator = 1e-300;

template <int D, class Wide>
FCLIB_IN_LANES Wide tangential_norm(const Wide* x) {
  Wide square = x[1] * x[1];
  if constexpr (D == 3) square += x[2] * x[2];
  return square.sqrt();
}

/// The square of the natural map with rho, as in contact/coulomb.hpp, in each lane. The projection
/// is chosen by minima and maxima, without a branch. Its rounding is that of u^ = u + mu ||u_T||.
template <int D, class Wide>
FCLIB_IN_LANES Wide map_square(const Wide& mu, const Wide& over, const Wide& slip, const Wide& rho,
                               const Wide* u, const Wide* r) {
  Wide y[D];
  for (int i = 1; i < D; ++i) y[i] = r[i] - rho * u[i];
  y[0] = r[0] - rho * (u[0] + slip);
  const Wide norm = tangential_norm<D>(y);
  const Wide normal = ((y[0] + mu * norm) * over).max(y[0]).max(0.0);
  const Wide scale = (mu * normal / norm.max(least_denominator)).min(1.0);
  const Wide left = r[0] - normal;
  Wide square = left * left;
  for (int i = 1; i < D; ++i) {
    const Wide by = r[i] - scale * y[i];
    square += by * by;
  }
  return square;
}

/// r moved against u, and put on the disk of its normal part.
template <int D, class Wide>
FCLIB_IN_LANES void projected_step(const Wide& normal, const Wide& tangent, const Wide& mu,
                                   const Wide* u, Wide* r) {
  r[0] = (r[0] - normal * u[0]).max(0.0);
  for (int i = 1; i < D; ++i) r[i] -= tangent * u[i];
  const Wide scale = (mu * r[0] / tangential_norm<D>(r).max(least_denominator)).min(1.0);
  for (int i = 1; i < D; ++i) r[i] *= scale;
}

}  // namespace fclib
