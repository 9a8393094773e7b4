#include "chain/table.hpp"

#include <algorithm>

#include "chain/description.hpp"
#include "error.hpp"

namespace fclib::chain {

namespace {

constexpr std::string_view blanks = " \t\r";

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(blanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

/// The name of a stage in messages.
struct Place {
  std::string name;
  int line = 0;

  [[noreturn]] void fail(const std::string& message) const {
    throw Error(ErrorKind::option, message,
                "option chain: " + (name.empty() ? "" : "stage '" + name + "', ") + "line " +
                    std::to_string(line));
  }
};

/// Calls f(T{}) with the method of this name.
template <std::size_t Next = 0, class F>
bool with_method(std::string_view name, const F& f) {
  if constexpr (Next < std::variant_size_v<Method>) {
    using T = std::variant_alternative_t<Next, Method>;
    if (T::name != name) return with_method<Next + 1>(name, f);
    f(T{});
    return true;
  } else {
    return false;
  }
}

template <class F>
void for_each_method(const F& f) {
  [&]<std::size_t... K>(std::index_sequence<K...>) {
    (f(std::variant_alternative_t<K, Method>{}), ...);
  }(std::make_index_sequence<std::variant_size_v<Method>>{});
}

std::string listed(const std::vector<OptionInfo>& infos) {
  std::string result;
  for (const OptionInfo& info : infos) result += (result.empty() ? "" : ", ") + info.name;
  return result;
}

bool has(const std::vector<OptionInfo>& infos, std::string_view name) {
  return std::any_of(infos.begin(), infos.end(),
                     [&](const OptionInfo& info) { return info.name == name; });
}

template <class T>
T parsed(const OptionValues& values, const Place& place) {
  try {
    return parse_options<T>(values);
  } catch (const Error& error) {
    place.fail(error.where + ": " + error.message);
  }
}

StageRule parse_stage(std::string_view text, int line) {
  Place place{.name = {}, .line = line};
  const auto colon = text.find(':');
  if (colon == std::string_view::npos) {
    place.fail("'" + std::string(text) + "' is not NAME : METHOD key=value ...");
  }
  place.name = trimmed(text.substr(0, colon));
  if (place.name.empty()) place.fail("a stage has no name before ':'");
  std::string_view rest = trimmed(text.substr(colon + 1));
  std::vector<std::string> words;
  while (!rest.empty()) {
    const auto end = std::min(rest.find_first_of(blanks), rest.size());
    words.emplace_back(rest.substr(0, end));
    rest = trimmed(rest.substr(end));
  }
  if (words.empty()) place.fail("names no method after ':'");

  StageRule stage{.name = place.name, .when = {}, .method = {}};
  const bool known = with_method(words[0], [&]<class T>(T) {
    static const std::vector<OptionInfo> when = describe_options<When>();
    static const std::vector<OptionInfo> own = describe_options<T>();
    OptionValues of_when;
    OptionValues of_method;
    for (std::size_t k = 1; k < words.size(); ++k) {
      const auto equals = words[k].find('=');
      if (equals == std::string::npos || equals == 0 || equals + 1 == words[k].size()) {
        place.fail("'" + words[k] + "' is not key=value");
      }
      const std::string key = words[k].substr(0, equals);
      if (!has(when, key) && !has(own, key)) {
        place.fail("'" + key + "' is no rule of " + std::string(T::name) +
                   ", which has: " + listed(own) + "; and of every stage: " + listed(when));
      }
      OptionValues& values = has(when, key) ? of_when : of_method;
      if (values.contains(key)) place.fail("'" + key + "' is there twice");
      values[key] = words[k].substr(equals + 1);
    }
    stage.when = parsed<When>(of_when, place);
    stage.method = parsed<T>(of_method, place);
  });
  if (!known) {
    std::string names;
    for_each_method(
        [&]<class T>(T) { names += (names.empty() ? "" : ", ") + std::string(T::name); });
    place.fail("'" + words[0] + "' is no method; there is: " + names);
  }
  return stage;
}

}  // namespace

std::string_view families_of(const Method& method) {
  return std::visit([](const auto& own) { return std::string_view(own.families); }, method);
}

std::optional<Start> chosen_start(const Method& method) {
  return std::visit(
      [](const auto& own) -> std::optional<Start> {
        if constexpr (requires { own.from; }) return own.from;
        return std::nullopt;
      },
      method);
}

Table parse_table(std::string_view text) {
  Table table;
  for (int line = 1; !text.empty(); ++line) {
    const auto end = std::min(text.find('\n'), text.size());
    std::string_view part = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    part = part.substr(0, part.find('#'));
    while (!part.empty()) {
      const auto stop = std::min(part.find(';'), part.size());
      const std::string_view stage = trimmed(part.substr(0, stop));
      part.remove_prefix(std::min(stop + 1, part.size()));
      if (stage.empty()) continue;
      StageRule rule = parse_stage(stage, line);
      const auto same = std::find_if(table.begin(), table.end(), [&](const StageRule& other) {
        return other.name == rule.name && families_of(other.method) != families_of(rule.method);
      });
      if (same != table.end()) {
        Place{.name = rule.name, .line = line}.fail(
            "has the name of a stage of another family of methods: results could not tell them "
            "apart");
      }
      table.push_back(std::move(rule));
    }
  }
  if (table.empty()) throw Error(ErrorKind::option, "has no stage", "option chain");
  return table;
}

std::vector<MethodInfo> describe_methods() {
  std::vector<MethodInfo> result;
  result.push_back({"", "Where a stage applies.", describe_options<When>()});
  for_each_method([&]<class T>(T) {
    result.push_back({std::string(T::name), std::string(T::doc), describe_options<T>()});
  });
  return result;
}

}  // namespace fclib::chain
