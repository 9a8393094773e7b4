// Options of a solver: a plain struct with defaults in place, listed once in fields().
//
// The checks (in options.cpp), the Python keywords, the CLI's --option and the documentation all
// come from that list.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <variant>
#include <vector>

namespace fclib {

/// A value as a caller gives it. Text is accepted for every type: the command line has nothing
/// else.
using OptionValue = std::variant<bool, std::int64_t, double, std::string>;
using OptionValues = std::map<std::string, OptionValue, std::less<>>;

/// An option as a user sees it.
struct OptionInfo {
  std::string name;
  std::string type;  ///< "bool", "int", "float", "choice" or "text"
  OptionValue default_value;
  std::string unit;
  std::string doc;
  std::vector<std::string> choices;
  double lowest = -std::numeric_limits<double>::infinity();
  double highest = std::numeric_limits<double>::infinity();
  void (*check)(std::string_view) = nullptr;  ///< for a text: throws Error (option) if it is wrong

  /// The place of a choice in `choices`.
  [[nodiscard]] std::size_t place_of(const OptionValue& choice) const;
};

/// All of these options, each of its own type: the given values, and defaults for the rest. Throws
/// Error (option) for an unknown name, or a value of the wrong type or out of range.
OptionValues parse_options(const std::vector<OptionInfo>& infos, const OptionValues& values);

/// A numeric (double, int64 or bool) option, a text, or an enumeration with the names of its
/// values.
template <class Options, class Value>
struct OptionField {
  std::string_view name;
  Value Options::* member;
  std::string_view unit = {};
  std::string_view doc = {};
  std::span<const std::string_view> choices = {};
  double lowest = -std::numeric_limits<double>::infinity();
  double highest = std::numeric_limits<double>::infinity();
  void (*check)(std::string_view) = nullptr;
};

/// The range of a number, ends included.
struct Bounds {
  double lowest = -std::numeric_limits<double>::infinity();
  double highest = std::numeric_limits<double>::infinity();
};

/// An option of a struct, one line for each kind: a number, ...
template <class Options, class Value>
constexpr OptionField<Options, Value> option(std::string_view name, Value Options::* member,
                                             std::string_view unit, Bounds bounds,
                                             std::string_view doc) {
  return {.name = name,
          .member = member,
          .unit = unit,
          .doc = doc,
          .lowest = bounds.lowest,
          .highest = bounds.highest};
}
/// ... yes or no, ...
template <class Options>
constexpr OptionField<Options, bool> flag(std::string_view name, bool Options::* member,
                                          std::string_view doc) {
  return {.name = name, .member = member, .doc = doc};
}
/// ... one of an enumeration, with the names of its values, ...
template <class Options, class Value>
constexpr OptionField<Options, Value> choice(std::string_view name, Value Options::* member,
                                             std::span<const std::string_view> choices,
                                             std::string_view doc) {
  return {.name = name, .member = member, .doc = doc, .choices = choices};
}
/// ... or a text. `check` throws Error (option) if the text is wrong.
template <class Options>
constexpr OptionField<Options, std::string> text(std::string_view name,
                                                 std::string Options::* member,
                                                 std::string_view doc,
                                                 void (*check)(std::string_view)) {
  return {.name = name, .member = member, .doc = doc, .check = check};
}

namespace detail {

OptionInfo describe_option(std::string_view name, std::string_view unit, std::string_view doc,
                           std::span<const std::string_view> choices, double lowest,
                           double highest);

/// `Struct` may be derived from the struct that has the member.
template <class Options, class Value, class Struct>
OptionInfo describe_option(const OptionField<Options, Value>& field, const Struct& defaults) {
  OptionInfo info = describe_option(field.name, field.unit, field.doc, field.choices, field.lowest,
                                    field.highest);
  const Value value = defaults.*field.member;
  if constexpr (std::is_enum_v<Value>) {
    info.type = "choice";
    info.default_value = info.choices.at(static_cast<std::size_t>(value));
  } else if constexpr (std::is_same_v<Value, bool>) {
    info.type = "bool";
    info.default_value = value;
  } else if constexpr (std::is_same_v<Value, double>) {
    info.type = "float";
    info.default_value = value;
  } else if constexpr (std::is_same_v<Value, std::string>) {
    info.type = "text";
    info.default_value = value;
    info.check = field.check;
  } else {
    info.type = "int";
    info.default_value = std::int64_t{value};
  }
  return info;
}

template <class Value>
Value value_of(const OptionInfo& info, const OptionValue& parsed) {
  if constexpr (std::is_enum_v<Value>) {
    return static_cast<Value>(info.place_of(parsed));
  } else if constexpr (std::is_same_v<Value, bool> || std::is_same_v<Value, double> ||
                       std::is_same_v<Value, std::string>) {
    return std::get<Value>(parsed);
  } else {
    return static_cast<Value>(std::get<std::int64_t>(parsed));
  }
}

}  // namespace detail

template <class Options>
std::vector<OptionInfo> describe_options() {
  std::vector<OptionInfo> result;
  const Options defaults;
  std::apply(
      [&](const auto&... field) {
        (result.push_back(detail::describe_option(field, defaults)), ...);
      },
      Options::fields());
  return result;
}

/// The options of a solver: the given values, and defaults for the rest. Throws like the function
/// above.
template <class Options>
Options parse_options(const OptionValues& values) {
  Options options;
  if (values.empty()) return options;
  static const std::vector<OptionInfo> infos = describe_options<Options>();
  const OptionValues parsed = parse_options(infos, values);
  std::apply(
      [&, info = infos.begin()](const auto&... field) mutable {
        ((options.*field.member =
              detail::value_of<std::remove_reference_t<decltype(options.*field.member)>>(
                  *info, parsed.find(field.name)->second),
          ++info),
         ...);
      },
      Options::fields());
  return options;
}

}  // namespace fclib
