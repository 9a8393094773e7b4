// From a method for any cone to the function of a solver's entry.
#pragma once

#include "reduced/with_cone.hpp"
#include "solve/options.hpp"
#include "solve/solver.hpp"

namespace fclib {

/// Reads the options, then calls method.operator()<Cone>(problem, options, settings, r) with the
/// cone of the problem's contacts.
template <class Options, class Method>
auto by_cone(Method method) {
  return [method](const ReducedProblem& problem, const OptionValues& values,
                  const Settings& settings, Vector& r) -> Outcome {
    const auto options = parse_options<Options>(values);
    return with_cone(problem, [&]<class Cone>() {
      return method.template operator()<Cone>(problem, options, settings, r);
    });
  };
}

}  // namespace fclib
