// Problems and solutions as plain JavaScript objects, by their fields(): what bindings/fields.hpp
// is for Python.
#pragma once

#include <emscripten/val.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "convert/storage.hpp"
#include "error.hpp"
#include "problem.hpp"

namespace fclib::browser {

using emscripten::val;

// ---- to JavaScript; arrays are copies

template <class Number>
val to_js(const Number* values, std::size_t size) {
  return val(emscripten::typed_memory_view(size, values)).call<val>("slice");
}
inline val to_js(const Vector& values) {
  return to_js(values.data(), static_cast<std::size_t>(values.size()));
}
template <class Number>
val to_js(const std::vector<Number>& values) {
  return to_js(values.data(), values.size());
}
inline val to_js(const std::string& text) { return val(text); }
inline val to_js(std::string_view text) { return val(std::string(text)); }
inline val to_js(double value) { return val(value); }
inline val to_js(Index value) { return val(value); }
inline val to_js(std::int64_t value) { return val(static_cast<double>(value)); }

template <class Struct>
val members_of(const Struct& self);

inline val to_js(const Matrix& a) {
  val result = val::object();
  result.set("storage", to_js(name_of(a.storage)));
  result.set("rows", a.rows);
  result.set("cols", a.cols);
  if (a.storage != Storage::dense) {
    result.set("p", to_js(a.p));
    result.set("i", to_js(a.i));
  }
  result.set("x", to_js(a.x));
  if (a.info) result.set("info", members_of(*a.info));
  return result;
}

/// All members that are there.
template <class Struct>
val members_of(const Struct& self) {
  val result = val::object();
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    const Member& member = self.*field.member;
    bool absent = false;
    if constexpr (std::is_same_v<Member, Matrix>) {
      absent = field.presence != Presence::required && member.empty();
    } else if constexpr (std::is_same_v<Member, Vector>) {
      absent = field.presence != Presence::required && member.size() == 0;
    }
    if (!absent) result.set(std::string(field.name), to_js(member));
  });
  return result;
}

template <class P>
val problem_to_js(const P& problem) {
  val result = val::object();
  result.set("kind", to_js(P::kind));
  const val members = members_of(problem);
  result = val::global("Object").call<val>("assign", result, members);
  result.set("info", members_of(problem.info));
  if (problem.geometry) {
    Geometry::for_each_table([&](std::string_view name, Geometry::Table Geometry::* member) {
      const Geometry::Table& table = (*problem.geometry).*member;
      if (table.empty()) return;
      val columns = val::object();
      for (const auto& [key, column] : table) {
        columns.set(key, std::visit([](const auto& values) { return to_js(values); }, column));
      }
      result.set(std::string(name), columns);
    });
  }
  return result;
}

// ---- from JavaScript

[[noreturn]] inline void unfit(const std::string& where, const std::string& message) {
  throw Error(ErrorKind::problem, message, where);
}

inline bool is_missing(const val& value) { return value.isUndefined() || value.isNull(); }

inline std::string type_of(const val& value) { return value.typeOf().as<std::string>(); }

/// Numbers of a typed array, or of a plain one.
template <class Number>
std::vector<Number> numbers_from(const val& array, const std::string& where) {
  const bool typed =
      val::global("ArrayBuffer").call<bool>("isView", array) && !array["length"].isUndefined();
  if (!typed && !array.isArray()) unfit(where, "is not an array of numbers");
  std::vector<Number> result(static_cast<std::size_t>(array["length"].as<double>()));
  val(emscripten::typed_memory_view(result.size(), result.data())).call<void>("set", array);
  return result;
}

inline Vector vector_from(const val& array, const std::string& where) {
  const std::vector<double> values = numbers_from<double>(array, where);
  return Eigen::Map<const Vector>(values.data(), static_cast<Eigen::Index>(values.size()));
}

inline Index integer_from(const val& value, const std::string& where) {
  const double number = type_of(value) == "number" ? value.as<double>() : std::nan("");
  if (!(std::abs(number) <= std::numeric_limits<Index>::max()) || number != std::trunc(number)) {
    unfit(where, "is not an integer of 32 bits");
  }
  return static_cast<Index>(number);
}

inline std::vector<Index> indices_from(const val& array, const std::string& where) {
  if (array.instanceof(val::global("Int32Array"))) return numbers_from<Index>(array, where);
  const std::vector<double> values = numbers_from<double>(array, where);
  std::vector<Index> result;
  for (const double value : values) result.push_back(integer_from(val(value), where));
  return result;
}

inline std::string text_from(const val& value, const std::string& where) {
  if (type_of(value) != "string") unfit(where, "is not a text");
  return value.as<std::string>();
}

inline Matrix matrix_from(const val& object, const std::string& where) {
  if (type_of(object) != "object") unfit(where, "is not a matrix { storage, rows, cols, p, i, x }");
  Matrix a;
  const val storage = object["storage"];
  if (is_missing(storage)) unfit(where + ".storage", "is missing");
  a.storage = storage_of(text_from(storage, where + ".storage"));
  a.rows = integer_from(object["rows"], where + ".rows");
  a.cols = integer_from(object["cols"], where + ".cols");
  if (a.storage != Storage::dense) {
    a.p = indices_from(object["p"], where + ".p");
    a.i = indices_from(object["i"], where + ".i");
  }
  a.x = numbers_from<double>(object["x"], where + ".x");
  return a;
}

/// Fills a struct from an object's properties; others that it has are passed over.
template <class Struct>
void fill(Struct& self, const val& object) {
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    const std::string name(field.name);
    const val value = object[name];
    constexpr bool array = std::is_same_v<Member, Matrix> || std::is_same_v<Member, Vector>;
    if (is_missing(value)) {
      if (array && field.presence == Presence::required) unfit(name, "is missing");
      return;
    }
    if constexpr (std::is_same_v<Member, Matrix>) {
      self.*field.member = matrix_from(value, name);
    } else if constexpr (std::is_same_v<Member, Vector>) {
      self.*field.member = vector_from(value, name);
    } else if constexpr (std::is_same_v<Member, Index>) {
      self.*field.member = integer_from(value, name);
    } else {
      self.*field.member = text_from(value, name);
    }
  });
}

inline Geometry::Table table_from(const val& object, const std::string& where) {
  Geometry::Table table;
  const val keys = val::global("Object").call<val>("keys", object);
  for (int k = 0; k < keys["length"].as<int>(); ++k) {
    const auto key = keys[k].as<std::string>();
    const val column = object[key];
    if (type_of(column) == "string") {
      table[key] = column.as<std::string>();
    } else if (column.instanceof(val::global("Int32Array"))) {
      table[key] = numbers_from<Index>(column, where + "." + key);
    } else {
      table[key] = numbers_from<double>(column, where + "." + key);
    }
  }
  return table;
}

/// The problem of a plain object, not validated.
inline Problem problem_from(const val& object) {
  if (type_of(object) != "object" || object.isNull()) unfit("problem", "is not an object");
  const val kind = object["kind"];
  const std::string name = type_of(kind) == "string" ? kind.as<std::string>() : "";
  Problem result;
  bool found = false;
  std::string known;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    known += (known.empty() ? "" : ", ") + std::string(P::kind);
    if (name != P::kind) return;
    found = true;
    P problem;
    fill(problem, object);
    if (!is_missing(object["info"])) fill(problem.info, object["info"]);
    auto geometry = std::make_shared<Geometry>();
    Geometry::for_each_table([&](std::string_view table, Geometry::Table Geometry::* member) {
      const val columns = object[std::string(table)];
      if (!is_missing(columns)) (*geometry).*member = table_from(columns, std::string(table));
    });
    if (!geometry->contacts.empty() || !geometry->bodies.empty()) problem.geometry = geometry;
    result = std::move(problem);
  });
  if (!found) unfit("kind", "is '" + name + "', but must be one of: " + known);
  return result;
}

inline Solution solution_from(const val& object) {
  if (type_of(object) != "object" || object.isNull()) unfit("solution", "is not an object");
  Solution solution;
  fill(solution, object);
  return solution;
}

}  // namespace fclib::browser
