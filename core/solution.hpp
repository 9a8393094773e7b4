// A solution (or a guess) of any formulation.
#pragma once

#include <tuple>

#include "field.hpp"
#include "linalg/matrix.hpp"

namespace fclib {

struct Solution {
  Vector v{};
  Vector u{};
  Vector r{};
  Vector l{};

  static constexpr auto fields() {
    using S = Solution;
    return std::tuple{
        Field<S, Vector>{.name = "v",
                         .member = &S::v,
                         .rows = Dim::n,
                         .presence = Presence::optional,
                         .unit = "m/s",
                         .doc = "generalised velocity (global problems)"},
        Field<S, Vector>{.name = "u",
                         .member = &S::u,
                         .rows = Dim::m,
                         .presence = Presence::optional,
                         .unit = "m/s",
                         .doc = "relative velocity at the contacts"},
        Field<S, Vector>{.name = "r",
                         .member = &S::r,
                         .rows = Dim::m,
                         .unit = "N s",
                         .doc = "reaction at the contacts (an impulse)"},
        Field<S, Vector>{.name = "l",
                         .member = &S::l,
                         .rows = Dim::p,
                         .presence = Presence::mixed,
                         .unit = "N s",
                         .doc = "lambda, the multiplier of the bilateral constraints"},
    };
  }
};

}  // namespace fclib
