// A field of a problem or of a solution: name, shape, unit and meaning, written once.
//
// Each struct of problems/ lists its members in fields(); HDF5 input and output, validation, the
// Python bindings and the documentation loop over that list and name no member themselves.
#pragma once

#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>

namespace fclib {

/// A length that fields share: degrees of freedom n, local unknowns m = d nc, bilateral
/// constraints p, contacts nc, those nr that resist rolling too; `one` for scalars and vectors'
/// second extent.
enum class Dim { one, n, m, p, nc, nr };

constexpr std::string_view name_of(Dim dim) {
  switch (dim) {
    case Dim::one:
      return "1";
    case Dim::n:
      return "n";
    case Dim::m:
      return "m";
    case Dim::p:
      return "p";
    case Dim::nc:
      return "nc";
    case Dim::nr:
      return "nr";
  }
  return "?";
}

/// Whether a member must be there. `mixed` members are all there or all absent: they are what
/// bilateral constraints add to a problem.
enum class Presence { required, optional, mixed };

/// What the numbers of a field must satisfy, beyond being finite.
enum class Range { any, nonnegative };

template <class Struct, class Member>
struct Field {
  std::string_view name;
  Member Struct::* member;
  Dim rows = Dim::one;
  Dim cols = Dim::one;
  Presence presence = Presence::required;
  std::string_view unit = {};
  std::string_view doc = {};
  Range range = Range::any;
};

/// Calls visit(field) for every field of Struct, in the order they are listed.
template <class Struct, class Visitor>
constexpr void for_each_field(Visitor&& visit) {
  std::apply([&](const auto&... field) { (visit(field), ...); }, Struct::fields());
}

}  // namespace fclib
