// Problems and solutions from JavaScript and back, by their fields(), as bindings/fields.hpp does
// for Python. JavaScript gets them as plain objects. The core gets them as numbers in memory, which
// fclib.js has written there: if the core looked up one property of an object, this would take as
// long as an iteration on a small problem.
#pragma once

#include <emscripten/val.h>

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>
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

/// What fclib.js has put into one block of memory: arrays, and behind them integers that say what
/// they are. A call reads it before it does anything else; the next one writes over it.
class Block {
 public:
  /// The address of so many bytes; 0 if there are none left.
  static int reserve(double bytes) {
    if (bytes > static_cast<double>(size_)) {
      std::free(bytes_);
      bytes_ = std::malloc(static_cast<std::size_t>(bytes));
      size_ = bytes_ != nullptr ? static_cast<std::size_t>(bytes) : 0;
    }
    return reinterpret_cast<int>(bytes_);
  }

  /// `address` points to the integers. The first of them is the size of the arrays [bytes].
  explicit Block(int address) : next_(reinterpret_cast<const std::int32_t*>(address)) {
    arrays_ = reinterpret_cast<const char*>(address) - integer();
  }
  Block(const Block&) = delete;
  Block& operator=(const Block&) = delete;
  ~Block() {
    if (size_ <= small) return;
    std::free(bytes_);
    bytes_ = nullptr;
    size_ = 0;
  }

  std::int32_t integer() { return *next_++; }

  /// The numbers of an array; empty if it was left out.
  template <class Number>
  std::span<const Number> array() {
    const std::int32_t offset = integer();
    const auto size = static_cast<std::size_t>(integer());
    return {reinterpret_cast<const Number*>(arrays_ + offset), size};
  }

 private:
  static constexpr std::size_t small = 1 << 20;  // [bytes] that may be kept for the next call
  inline static void* bytes_ = nullptr;
  inline static std::size_t size_ = 0;

  const std::int32_t* next_;
  const char* arrays_;
};

inline Vector vector_from(Block& block) {
  const auto values = block.array<double>();
  return Eigen::Map<const Vector>(values.data(), static_cast<Eigen::Index>(values.size()));
}

template <class Number>
std::vector<Number> numbers_from(Block& block) {
  const auto values = block.array<Number>();
  return {values.begin(), values.end()};
}

inline Matrix matrix_from(Block& block) {
  Matrix a;
  if (block.integer() == 0) return a;
  a.storage = static_cast<Storage>(block.integer());
  a.rows = block.integer();
  a.cols = block.integer();
  a.p = numbers_from<Index>(block);
  a.i = numbers_from<Index>(block);
  a.x = numbers_from<double>(block);
  return a;
}

/// Fills a struct of numbers, whose fields fclib.js has in the same order.
template <class Struct>
void fill(Struct& self, Block& block) {
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    if constexpr (std::is_same_v<Member, Matrix>) {
      self.*field.member = matrix_from(block);
    } else if constexpr (std::is_same_v<Member, Vector>) {
      self.*field.member = vector_from(block);
    } else {
      static_assert(std::is_same_v<Member, Index>);
      if (block.integer() != 0) self.*field.member = block.integer();
    }
  });
}

/// The problem of a block, not validated.
inline Problem problem_from(Block& block) {
  const std::int32_t kind = block.integer();
  Problem result;
  std::int32_t number = 0;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if (number++ != kind) return;
    P problem;
    fill(problem, block);
    result = std::move(problem);
  });
  return result;
}

inline Solution solution_from(Block& block) {
  Solution solution;
  fill(solution, block);
  return solution;
}

// ---- what a problem only carries along, from its object

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

/// Other properties of the object are ignored.
inline void fill(ProblemInfo& self, const val& object) {
  for_each_field<ProblemInfo>([&](const Field<ProblemInfo, std::string>& field) {
    const std::string name(field.name);
    const val value = object[name];
    if (is_missing(value)) return;
    if (type_of(value) != "string") unfit(name, "is not a text");
    self.*field.member = value.as<std::string>();
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

/// The words and the geometry of a problem.
template <class P>
void carry(P& problem, const val& object) {
  if (!is_missing(object["info"])) fill(problem.info, object["info"]);
  auto geometry = std::make_shared<Geometry>();
  Geometry::for_each_table([&](std::string_view table, Geometry::Table Geometry::* member) {
    const val columns = object[std::string(table)];
    if (!is_missing(columns)) (*geometry).*member = table_from(columns, std::string(table));
  });
  if (!geometry->contacts.empty() || !geometry->bodies.empty()) problem.geometry = geometry;
}

}  // namespace fclib::browser
