// From the dimensions of a problem to the type of its cone.
#pragma once

#include "contact/coulomb.hpp"
#include "contact/rolling.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

/// Calls run.operator()<Cone>() with the cone of the problem's contacts.
template <class Run>
auto with_cone(const ReducedProblem& problem, const Run& run) {
  if (problem.rolling()) {
    return problem.d() == 3 ? run.template operator()<Rolling<3>>()
                            : run.template operator()<Rolling<5>>();
  }
  return problem.d() == 2 ? run.template operator()<Coulomb<2>>()
                          : run.template operator()<Coulomb<3>>();
}

}  // namespace fclib
