// From the coefficients of a problem to its cone, for what judges solutions.
#pragma once

#include "contact/cones.hpp"
#include "contact/ellipsoid.hpp"

namespace fclib {

/// Calls run.operator()<Cone>() with the cone of the contacts of a problem, of d components each.
template <class Real = double, class Run>
auto with_cone(int d, const Friction& friction, const Run& run) {
  if (friction.mu_s.size() > 0) {
    if (friction.coupled) return run.template operator()<Ellipsoid<Real>>();
    return d == 4 ? run.template operator()<Spin<4, Real>>()
                  : run.template operator()<Spin<6, Real>>();
  }
  if (friction.mu_r.size() > 0) {
    return d == 3 ? run.template operator()<Rolling<3, Real>>()
                  : run.template operator()<Rolling<5, Real>>();
  }
  return d == 2 ? run.template operator()<Coulomb<2, Real>>()
                : run.template operator()<Coulomb<3, Real>>();
}

}  // namespace fclib
