// The error that solvers measure themselves by: the relative natural map on the reduced form.
#pragma once

#include <cmath>

#include "cones/coulomb.hpp"
#include "linalg/matrix.hpp"

namespace fclib {

/// ||r - P_K(r - u^)||^2 summed over the contacts; u and r of length D nc.
template <int D>
double natural_map_squared(const Vector& u, const Vector& r, const Vector& mu) {
  double sum = 0;
  for (Eigen::Index contact = 0; contact < mu.size(); ++contact) {
    const ContactVector<D> velocity = u.segment<D>(D * contact);
    const ContactVector<D> reaction = r.segment<D>(D * contact);
    sum += natural_map<D>(velocity, reaction, mu[contact]).squaredNorm();
  }
  return sum;
}

}  // namespace fclib
