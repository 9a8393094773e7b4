// The tables of a problem's geometry in Python: objects of fclib._geometry, made of named columns.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <string>
#include <utility>

#include "arrays.hpp"
#include "geometry.hpp"

namespace fclib::bindings {

/// "fclib._geometry.Contacts" for the table "contacts".
inline std::string geometry_class(std::string_view table) {
  return table == "contacts" ? "Contacts" : "Bodies";
}

/// The table as an object, or None if it is empty. The object keeps the problem alive.
template <class P>
nb::object geometry_of(nb::handle self, std::string_view name, Geometry::Table Geometry::* member) {
  const auto& problem = nb::cast<const P&>(self);
  if (!problem.geometry || ((*problem.geometry).*member).empty()) return nb::none();
  nb::dict columns;
  for (const auto& column : (*problem.geometry).*member) {
    columns[column.first.c_str()] = std::visit(
        [&]<class Values>(const Values& values) -> nb::object {
          if constexpr (std::is_same_v<Values, std::string>) {
            return nb::steal(PyUnicode_DecodeUTF8(
                values.data(), static_cast<Py_ssize_t>(values.size()), "replace"));
          } else {
            return view(values.data(), values.size(), self);
          }
        },
        column.second);
  }
  const nb::object made =
      nb::module_::import_("fclib._geometry").attr(geometry_class(name).c_str());
  return name == "contacts" ? made.attr("of")(columns, problem.size(Dim::nc))
                            : made.attr("of")(columns);
}

/// The table of an object that has columns().
inline Geometry::Table table_from(nb::handle object, std::string_view name) {
  Geometry::Table table;
  if (object.is_none()) return table;
  const std::string expected = geometry_class(name);
  if (!nb::hasattr(object, "columns") ||
      nb::cast<std::string>(object.type().attr("__name__")) != expected) {
    throw nb::type_error((std::string(name) + " must be of type fclib." + expected).c_str());
  }
  using Integers = nb::ndarray<const std::int32_t, nb::c_contig, nb::device::cpu>;
  using Numbers = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
  for (const auto& [key, value] : nb::cast<nb::dict>(object.attr("columns")())) {
    Geometry::Column& column = table[nb::cast<std::string>(key)];
    if (nb::isinstance<nb::str>(value)) {
      column = nb::cast<std::string>(value);
    } else if (Integers integers; nb::try_cast(value, integers, false)) {
      column = std::vector<std::int32_t>(integers.data(), integers.data() + integers.size());
    } else {
      const auto numbers = nb::cast<Numbers>(value);
      column = std::vector<double>(numbers.data(), numbers.data() + numbers.size());
    }
  }
  return table;
}

}  // namespace fclib::bindings
