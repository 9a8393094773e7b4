// Options of a solver: a plain struct with defaults in place, listed once in fields().
//
// From that list come the checks, the Python keywords, the CLI's --option and the documentation.
#pragma once

#include <array>
#include <charconv>
#include <cmath>
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

#include "error.hpp"

namespace fclib {

/// A value as a caller gives it; text is accepted for every type (the command line has no other).
using OptionValue = std::variant<bool, std::int64_t, double, std::string>;
using OptionValues = std::map<std::string, OptionValue, std::less<>>;

/// An option as it is shown to a user.
struct OptionInfo {
  std::string name;
  std::string type;  ///< "bool", "int", "float" or "choice"
  OptionValue default_value;
  std::string unit;
  std::string doc;
  std::vector<std::string> choices;
  double lowest = -std::numeric_limits<double>::infinity();
  double highest = std::numeric_limits<double>::infinity();
};

/// A numeric (double, int64 or bool) option, or an enumeration with the names of its values.
template <class Options, class Value>
struct OptionField {
  std::string_view name;
  Value Options::* member;
  std::string_view unit = {};
  std::string_view doc = {};
  std::span<const std::string_view> choices = {};
  double lowest = -std::numeric_limits<double>::infinity();
  double highest = std::numeric_limits<double>::infinity();
};

namespace detail {

[[noreturn]] inline void bad_option(std::string_view name, const std::string& message) {
  throw Error(ErrorKind::option, message, "option " + std::string(name));
}

inline std::string to_text(const OptionValue& value) {
  struct Printer {
    std::string operator()(bool v) const { return v ? "true" : "false"; }
    std::string operator()(std::int64_t v) const { return std::to_string(v); }
    std::string operator()(double v) const {
      std::array<char, 32> buffer{};
      return {buffer.data(), std::to_chars(buffer.data(), buffer.data() + buffer.size(), v).ptr};
    }
    std::string operator()(const std::string& v) const { return v; }
  };
  return std::visit(Printer{}, value);
}

template <class Number>
bool parse_number(const std::string& text, Number& number) {
  const char* end = text.data() + text.size();
  const auto [stop, code] = std::from_chars(text.data(), end, number);
  return code == std::errc{} && stop == end;
}

template <class Options, class Value>
Value parse_option(const OptionField<Options, Value>& field, const OptionValue& value) {
  const std::string text = to_text(value);
  if constexpr (std::is_enum_v<Value>) {
    for (std::size_t k = 0; k < field.choices.size(); ++k) {
      if (field.choices[k] == text) return static_cast<Value>(k);
    }
    std::string known;
    for (const auto choice : field.choices)
      known += (known.empty() ? "" : ", ") + std::string(choice);
    bad_option(field.name, "'" + text + "' is not one of: " + known);
  } else if constexpr (std::is_same_v<Value, bool>) {
    if (text == "true" || text == "1") return true;
    if (text == "false" || text == "0") return false;
    bad_option(field.name, "'" + text + "' is not true or false");
  } else {
    Value number{};
    if (!parse_number(text, number) || !std::isfinite(static_cast<double>(number))) {
      const char* type = std::is_same_v<Value, double> ? "a number" : "an integer";
      bad_option(field.name, "'" + text + "' is not " + type);
    }
    if (static_cast<double>(number) < field.lowest || static_cast<double>(number) > field.highest) {
      bad_option(field.name, text + " is outside [" + to_text(OptionValue(field.lowest)) + ", " +
                                 to_text(OptionValue(field.highest)) + "]");
    }
    return number;
  }
}

template <class Options, class Value>
OptionInfo describe_option(const OptionField<Options, Value>& field, const Options& defaults) {
  OptionInfo info{.name = std::string(field.name),
                  .type = {},
                  .default_value = {},
                  .unit = std::string(field.unit),
                  .doc = std::string(field.doc),
                  .choices = {field.choices.begin(), field.choices.end()},
                  .lowest = field.lowest,
                  .highest = field.highest};
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
  } else {
    info.type = "int";
    info.default_value = std::int64_t{value};
  }
  return info;
}

}  // namespace detail

/// The options of a solver with the given values in place of the defaults. Throws Error (option)
/// for an unknown name, a value of the wrong type or out of range.
template <class Options>
Options parse_options(const OptionValues& values) {
  Options options;
  std::size_t used = 0;
  const auto for_each = [](const auto& visit) {
    std::apply([&](const auto&... field) { (visit(field), ...); }, Options::fields());
  };
  for_each([&](const auto& field) {
    if (const auto found = values.find(field.name); found != values.end()) {
      options.*field.member = detail::parse_option(field, found->second);
      ++used;
    }
  });
  if (used == values.size()) return options;
  for (const auto& [name, value] : values) {
    bool found = false;
    std::string known;
    for_each([&](const auto& field) {
      found = found || field.name == name;
      known += (known.empty() ? "" : ", ") + std::string(field.name);
    });
    if (!found) detail::bad_option(name, "unknown; this solver has: " + known);
  }
  return options;
}

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

/// The same checks for options that are known at run time alone: all of them, with the given values
/// in place of the defaults, each of its own type.
inline OptionValues parse_options(const std::vector<OptionInfo>& infos,
                                  const OptionValues& values) {
  struct Unknown {};
  enum class Choice : std::size_t {};
  const auto parse = []<class Value>(const OptionInfo& info, const OptionValue& value, Value) {
    const std::vector<std::string_view> choices(info.choices.begin(), info.choices.end());
    return detail::parse_option(OptionField<Unknown, Value>{.name = info.name,
                                                            .member = nullptr,
                                                            .choices = choices,
                                                            .lowest = info.lowest,
                                                            .highest = info.highest},
                                value);
  };
  OptionValues result;
  std::string known;
  for (const OptionInfo& info : infos) {
    known += (known.empty() ? "" : ", ") + info.name;
    const auto found = values.find(info.name);
    const OptionValue& value = found != values.end() ? found->second : info.default_value;
    if (info.type == "bool") {
      result[info.name] = parse(info, value, bool{});
    } else if (info.type == "int") {
      result[info.name] = parse(info, value, std::int64_t{});
    } else if (info.type == "float") {
      result[info.name] = parse(info, value, double{});
    } else {
      const Choice choice = parse(info, value, Choice{});
      result[info.name] = info.choices[static_cast<std::size_t>(choice)];
    }
  }
  for (const auto& [name, value] : values) {
    if (!result.contains(name)) {
      detail::bad_option(name, "unknown; this solver has: " + (known.empty() ? "none" : known));
    }
  }
  return result;
}

}  // namespace fclib
