// Numbers as text, the same on every machine and in every locale, and quoted text for messages.
//
// They do what std::to_chars and std::from_chars do, also if the standard library lacks that for
// doubles.
#pragma once

#include <charconv>
#include <string>
#include <string_view>
#include <system_error>

namespace fclib {

/// A number with the fewest digits that distinguish it from all other doubles.
std::string shortest(double value);

/// Reads a number at `first`, like std::from_chars. If it is too small or too large for a double,
/// the result is `result_out_of_range`, and `value` is the double next to it.
std::from_chars_result read_number(const char* first, const char* last, double& value);

/// A text from a file, in quotes, shortened, and without characters that a terminal should not get.
std::string quoted(std::string_view text);

// how they work without the library's functions, for tests
namespace detail {
std::string shortest_by_trial(double value);
std::from_chars_result read_by_strtod(const char* first, const char* last, double& value);
}  // namespace detail

}  // namespace fclib
