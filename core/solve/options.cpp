#include "solve/options.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "error.hpp"
#include "number_text.hpp"

namespace fclib {

namespace {

[[noreturn]] void bad_option(std::string_view name, const std::string& message) {
  throw Error(ErrorKind::option, message, "option " + std::string(name));
}

std::string to_text(const OptionValue& value) {
  struct Printer {
    std::string operator()(bool v) const { return v ? "true" : "false"; }
    std::string operator()(std::int64_t v) const { return std::to_string(v); }
    std::string operator()(double v) const { return shortest(v); }
    std::string operator()(const std::string& v) const { return v; }
  };
  return std::visit(Printer{}, value);
}

std::string listed(const auto& names) {
  std::string list;
  for (const auto& name : names) list += (list.empty() ? "" : ", ") + std::string(name);
  return list;
}

std::from_chars_result read(const char* first, const char* last, std::int64_t& number) {
  return std::from_chars(first, last, number);
}
std::from_chars_result read(const char* first, const char* last, double& number) {
  return read_number(first, last, number);
}

template <class Number>
Number parse_number(const OptionInfo& info, const std::string& text, const char* what) {
  Number number{};
  const char* end = text.data() + text.size();
  const auto [stop, code] = read(text.data(), end, number);
  if (code != std::errc{} || stop != end || !std::isfinite(static_cast<double>(number))) {
    bad_option(info.name, "'" + text + "' is not " + what);
  }
  const auto value = static_cast<double>(number);
  if (value < info.lowest || value > info.highest) {
    bad_option(info.name, text + " is outside [" + to_text(OptionValue(info.lowest)) + ", " +
                              to_text(OptionValue(info.highest)) + "]");
  }
  return number;
}

OptionValue parse_option(const OptionInfo& info, const OptionValue& value) {
  const std::string text = to_text(value);
  if (info.type == "bool") {
    if (text == "true" || text == "1") return true;
    if (text == "false" || text == "0") return false;
    bad_option(info.name, "'" + text + "' is not true or false");
  }
  if (info.type == "int") return parse_number<std::int64_t>(info, text, "an integer");
  if (info.type == "float") return parse_number<double>(info, text, "a number");
  if (info.type == "text") return text;
  if (std::find(info.choices.begin(), info.choices.end(), text) == info.choices.end()) {
    bad_option(info.name, "'" + text + "' is not one of: " + listed(info.choices));
  }
  return text;
}

}  // namespace

std::size_t OptionInfo::place_of(const OptionValue& choice) const {
  const auto at = std::find(choices.begin(), choices.end(), std::get<std::string>(choice));
  return static_cast<std::size_t>(at - choices.begin());
}

OptionValues parse_options(const std::vector<OptionInfo>& infos, const OptionValues& values) {
  OptionValues result;
  std::vector<std::string_view> known;
  for (const OptionInfo& info : infos) {
    known.push_back(info.name);
    const auto found = values.find(info.name);
    if (found != values.end() && info.check != nullptr) info.check(to_text(found->second));
    result[info.name] =
        parse_option(info, found != values.end() ? found->second : info.default_value);
  }
  for (const auto& [name, value] : values) {
    if (!result.contains(name)) {
      bad_option(name, "unknown; this solver has: " + (known.empty() ? "none" : listed(known)));
    }
  }
  return result;
}

namespace detail {

OptionInfo describe_option(std::string_view name, std::string_view unit, std::string_view doc,
                           std::span<const std::string_view> choices, double lowest,
                           double highest) {
  return {.name = std::string(name),
          .type = {},
          .default_value = {},
          .unit = std::string(unit),
          .doc = std::string(doc),
          .choices = {choices.begin(), choices.end()},
          .lowest = lowest,
          .highest = highest};
}

}  // namespace detail

}  // namespace fclib
