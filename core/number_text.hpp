// Numbers as text, the same on every machine and in every locale; and what files say, for messages.
//
// What std::to_chars and std::from_chars do, for doubles too where the standard library lacks that.
#pragma once

#include <charconv>
#include <string>
#include <string_view>
#include <system_error>

namespace fclib {

/// A number with as few digits as tell it from all others.
std::string shortest(double value);

/// Reads a number at `first`, as std::from_chars does. One that is too small or too large for a
/// double is `result_out_of_range`, and `value` the double next to it.
std::from_chars_result read_number(const char* first, const char* last, double& value);

/// What stands in a file, between quotes, shortened and without what a terminal should not get.
std::string quoted(std::string_view text);

// what they do without the library's, for tests
namespace detail {
std::string shortest_by_trial(double value);
std::from_chars_result read_by_strtod(const char* first, const char* last, double& value);
}  // namespace detail

}  // namespace fclib
