// Contacts without others, several at once: each has a lane of the processor's vector registers.
// This is compiled for the processors that the build names, and for those with AVX2, whose
// registers hold as many numbers as there are lanes. Both ways have the same digits.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

#include "embed/local_arrays.hpp"
#include "linalg/processor.hpp"

namespace fclib {

/// What becomes of contacts without others.
struct Alone {
  static constexpr int most = 32;  ///< contacts in a call
  std::uint32_t solved = 0;        ///< a bit of each; others are for SmallSolver
  std::array<double, most> error;  ///< at least the merit's error of those that are solved, and
                                   ///< at most a thousandth of the tolerance above it
  std::array<std::int32_t, most> steps;  ///< ... and how many steps each took
};

/// Solves `count` contacts without others, at most Alone::most. r and u of those that a few steps
/// do not solve, or that have something that is not finite, stay as they were.
template <int D>
void solve_alone(double tolerance, int count, const LocalArrays& first, Alone& found);

/// The same, as any processor that the build names can do it.
template <int D>
void solve_alone_anywhere(double tolerance, int count, const LocalArrays& first, Alone& found);

#ifdef FCLIB_AVX2
/// The same, on a processor with AVX2; no templates, as g++ forgets the processor of those.
void solve_alone_avx2(std::integral_constant<int, 2> dimension, double tolerance, int count,
                      const LocalArrays& first, Alone& found);
void solve_alone_avx2(std::integral_constant<int, 3> dimension, double tolerance, int count,
                      const LocalArrays& first, Alone& found);
#endif

}  // namespace fclib
