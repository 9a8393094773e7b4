// What rounding may do to an error that is found in double precision.
#pragma once

#include <cstdint>
#include <limits>

namespace fclib {

/// A bound on the error is at most this part of the tolerance above the error.
constexpr double bounded_excess = 1e-3;
/// So the rounding in lanes is at most this part: what is found may be so much too large, and it is
/// added.
constexpr double bounded_rounding = bounded_excess / 2;
/// Roundings of the natural map of one contact, generously.
constexpr double roundings_of_the_map = 40;
/// Beyond these sizes squares in double precision may be lost, or be infinite.
constexpr double smallest_size = 1e-100;
constexpr double largest_size = 1e100;

/// Whether squares of numbers of this size are safe in double precision.
constexpr bool has_square(double size) { return size >= smallest_size && size <= largest_size; }

/// Of n numbers that are added, rounding changes the sum by at most n units of the sum of their
/// sizes. A row of W r + q of `nc` contacts has D nc terms.
template <int D>
constexpr double unit_of_rounding(std::int64_t nc) {
  return std::numeric_limits<double>::epsilon() *
         (static_cast<double>(D * nc) + roundings_of_the_map);
}

}  // namespace fclib
