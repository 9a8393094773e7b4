// The error that solvers measure themselves by: the natural map on the reduced form.
#pragma once

#include "cones/cone.hpp"
#include "linalg/matrix.hpp"

namespace fclib {

/// ||r - P_K(r - u^)||^2 summed over the contacts; u and r of length dim nc.
template <class Cone>
double natural_map_squared(const Vector& u, const Vector& r, const Friction& friction) {
  constexpr int d = Cone::dim;
  double sum = 0;
  for (Eigen::Index contact = 0; contact < friction.mu.size(); ++contact) {
    const Cone cone(friction, contact);
    sum += natural_map(cone, u.segment<d>(d * contact), r.segment<d>(d * contact)).squaredNorm();
  }
  return sum;
}

}  // namespace fclib
