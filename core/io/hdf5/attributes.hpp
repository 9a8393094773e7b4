// What an FCLIB file says of its problem or its solution beside the data: attributes of groups.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <variant>

#include "io/hdf5/write.hpp"

namespace fclib {

/// Numbers and texts by their names.
using Attributes = std::map<std::string, std::variant<double, std::string>>;

/// The attributes of a group that are one number or one text; others are left out, and there are
/// none where the file has no such group. The group is "solution", "guesses/K" of the guess K, or
/// "info" of the problem that a solution belongs to.
Attributes read_attributes(const std::string& path, std::string_view group);

/// Gives a group attributes, in place of those of the same names. They go with what they are of: a
/// solution, a guess or a problem that replaces another has none. Throws Error (file) where the
/// file has no solution, or no such guess.
void write_attributes(const std::string& path, std::string_view group,
                      const Attributes& attributes);

/// Gives the info group of the problem that read_outline() finds, the local one first, an integer
/// attribute.
void write_int_attribute(const std::string& path, const std::string& name, Index value,
                         const WriteOptions& options = {.replace = true});

}  // namespace fclib
