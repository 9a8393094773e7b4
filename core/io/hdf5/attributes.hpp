// What an FCLIB file says of its problem or its solution besides the data: attributes of groups.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <variant>

#include "io/hdf5/write.hpp"

namespace fclib {

/// Numbers and texts by their names.
using Attributes = std::map<std::string, std::variant<double, std::string>>;

/// The attributes of a group that are one number or one text. Others are left out. If the file has
/// no such group, the result is empty. The group is "solution", "guesses/K" for guess K, or "info"
/// of the problem that a solution belongs to.
Attributes read_attributes(const std::string& path, std::string_view group);

/// Gives a group attributes, in place of those of the same names. The attributes belong to their
/// solution, guess or problem: what replaces it has none. Throws Error (file) if the file has no
/// solution, or no such guess.
void write_attributes(const std::string& path, std::string_view group,
                      const Attributes& attributes);

/// Gives an integer attribute to the info group of the problem that read_outline() finds, the local
/// one first.
void write_int_attribute(const std::string& path, const std::string& name, Index value,
                         const WriteOptions& options = {.replace = true});

}  // namespace fclib
