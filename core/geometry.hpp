// Where the contacts of a problem lie and what touches there: two tables, /contacts and /bodies.
//
// The core carries the tables with a problem, and knows none of their columns. docs/format.md lists
// the columns; python/fclib/_geometry.py makes and checks them. No solver sees them.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace fclib {

struct Geometry {
  using Column = std::variant<std::vector<std::int32_t>, std::vector<double>, std::string>;
  using Table = std::map<std::string, Column, std::less<>>;
  Table contacts;
  Table bodies;

  /// Calls visit(name, member) for both tables, with their names as in a file.
  template <class Visitor>
  static void for_each_table(const Visitor& visit) {
    visit(std::string_view("contacts"), &Geometry::contacts);
    visit(std::string_view("bodies"), &Geometry::bodies);
  }
};

/// Shared by the copies of a problem. Null if nothing is known.
using GeometryPointer = std::shared_ptr<const Geometry>;

}  // namespace fclib
