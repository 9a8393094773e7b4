// From the dimensions of a problem to the type of its cone.
#pragma once

#include "contact/cones.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

/// Calls run.operator()<Cone>() with the cone of the problem's contacts, one of
/// FCLIB_FOR_EACH_CONE.
template <class Run>
auto with_cone(const ReducedProblem& problem, const Run& run) {
  const Friction& friction = problem.friction;
  const int d = problem.d();
  if (friction.mu_s.size() > 0) {
    return d == 4 ? run.template operator()<Spin<4>>() : run.template operator()<Spin<6>>();
  }
  if (friction.mu_r.size() > 0) {
    return d == 3 ? run.template operator()<Rolling<3>>() : run.template operator()<Rolling<5>>();
  }
  if (d == 4) return run.template operator()<Coulomb<4>>();
  return d == 2 ? run.template operator()<Coulomb<2>>() : run.template operator()<Coulomb<3>>();
}

}  // namespace fclib
