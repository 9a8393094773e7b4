// The functions of fclib.h that take settings by name and answer by name.
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "capi/errors.hpp"
#include "capi/from_c.hpp"
#include "capi/options.hpp"
#include "capi/status.hpp"
#include "merit/merit.hpp"
#include "solve/driver.hpp"

/// What a solve or a merit reports.
struct fclib_report {
  std::vector<std::pair<std::string, double>> numbers;
  std::vector<std::pair<std::string, std::string>> texts;
  std::vector<std::pair<std::string, fclib::Vector>> arrays;
};

namespace fclib::c {

namespace {

/// The settings of a solve besides the options of its solver.
struct Asked {
  std::string solver = "auto";
  double tolerance = Settings{}.tolerance;
  std::int64_t max_iterations = 0;
  double time_limit = 0;
  MeritKind merit = MeritKind::both;

  static constexpr std::array<std::string_view, 2> merits{"both", "natural"};
  static constexpr auto fields() {
    using A = Asked;
    return std::tuple{
        OptionField<A, std::string>{.name = "solver", .member = &A::solver},
        OptionField<A, double>{.name = "tolerance", .member = &A::tolerance, .lowest = 0},
        OptionField<A, std::int64_t>{
            .name = "max_iterations", .member = &A::max_iterations, .lowest = 0},
        OptionField<A, double>{.name = "time_limit", .member = &A::time_limit, .lowest = 0},
        OptionField<A, MeritKind>{.name = "merit", .member = &A::merit, .choices = merits},
    };
  }
};

/// The same as a text that reads back equal. Counts have no exponent.
std::string text_of(double value) {
  std::array<char, 32> buffer{};
  const bool count = value == std::trunc(value) && std::abs(value) < 1e15;
  const auto end = count ? std::to_chars(buffer.data(), buffer.data() + buffer.size(),
                                         static_cast<std::int64_t>(value))
                         : std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), end.ptr};
}

template <class Value>
const Value& named(const std::vector<std::pair<std::string, Value>>& all, const char* name) {
  const std::string_view wanted = &given(name, "name");
  std::string known;
  for (const auto& [key, value] : all) {
    if (key == wanted) return value;
    known += (known.empty() ? "" : ", ") + key;
  }
  fail("report", "has no '" + std::string(wanted) +
                     "' of this type; there are: " + (known.empty() ? "none" : known));
}

template <class C>
fclib_report* solve_with(const C* c, const fclib_options* options) {
  return guarded<fclib_report*>(nullptr, [&] {
    const auto problem = problem_of(given(c, "problem"));
    static const fclib_options none;
    if (options == nullptr) options = &none;
    static const std::vector<OptionInfo> own = describe_options<Asked>();
    OptionValues ours;
    OptionValues of_solver;
    for (const auto& given : options->values) {
      const bool known = std::any_of(
          own.begin(), own.end(), [&](const OptionInfo& info) { return info.name == given.first; });
      (known ? ours : of_solver).insert(given);
    }
    const Asked asked = parse_options<Asked>(ours);
    Settings settings;
    settings.tolerance = asked.tolerance;
    settings.merit = asked.merit;
    settings.max_iterations = asked.max_iterations;
    if (asked.time_limit > 0) settings.time_limit = asked.time_limit;
    if (options->progress != nullptr) {
      settings.callback = [options](const Progress& progress) {
        constexpr std::int64_t most = std::numeric_limits<int>::max();
        const std::string stage(progress.stage);
        return options->progress(static_cast<int>(std::min(progress.iteration, most)),
                                 progress.error, progress.time, stage.c_str(),
                                 options->context) == 0;
      };
    }
    Solution guess;
    for (const auto& [name, values] : options->arrays) {
      if (name != "guess") fail("options", "a solve has no array '" + name + "'; it has: guess");
      if (values.size() != problem.size(Dim::m)) {
        fail("guess", "has " + std::to_string(values.size()) + " entries, expected " +
                          std::to_string(problem.size(Dim::m)));
      }
      guess.r = values;
    }
    Result solved = solve(problem, asked.solver, settings, of_solver, guess);
    auto report = std::make_unique<fclib_report>();
    report->numbers = {{"error", solved.error},
                       {"iterations", static_cast<double>(solved.iterations)},
                       {"status", status_in_c(solved.status)},
                       {"cpu_s", solved.cpu_s},
                       {"time", solved.time},
                       {"setup_s", solved.setup_s},
                       {"certificate_bound", solved.certificate.bound}};
    report->texts = {{"status", std::string(name_of(solved.status))}, {"solver", solved.solver}};
    for_each_member<fclib_solution>([&](const auto& field, double* fclib_solution::*) {
      report->arrays.emplace_back(field.name, std::move(solved.solution.*field.member));
    });
    report->arrays.emplace_back("certificate_y", std::move(solved.certificate.y));
    report->arrays.emplace_back("certificate_z", std::move(solved.certificate.z));
    return report.release();
  });
}

template <class C>
fclib_report* judge(const C* c, const fclib_solution* solution) {
  return guarded<fclib_report*>(nullptr, [&] {
    const auto problem = valid_problem(given(c, "problem"));
    const Merit parts =
        merit(problem, solution_of(given(solution, "solution"), problem, Parts::some));
    auto report = std::make_unique<fclib_report>();
    for_each_field<Merit>([&](const auto& field) {
      report->numbers.emplace_back(field.name, static_cast<double>(parts.*field.member));
    });
    return report.release();
  });
}

std::string option_text(const OptionInfo& option, std::string_view what) {
  const auto written = [](const OptionValue& value) {
    if (const auto* number = std::get_if<double>(&value)) return text_of(*number);
    if (const auto* count = std::get_if<std::int64_t>(&value)) return std::to_string(*count);
    if (const auto* yes = std::get_if<bool>(&value)) return std::string(*yes ? "true" : "false");
    return std::get<std::string>(value);
  };
  if (what == "name") return option.name;
  if (what == "type") return option.type;
  if (what == "default") return written(option.default_value);
  if (what == "unit") return option.unit;
  if (what == "doc") return option.doc;
  if (what == "lowest") return written(option.lowest);
  if (what == "highest") return written(option.highest);
  if (what == "choices") {
    std::string list;
    for (const auto& choice : option.choices) list += (list.empty() ? "" : ", ") + choice;
    return list;
  }
  fail("option", "has no '" + std::string(what) +
                     "'; there are: name, type, default, unit, doc, lowest, highest, choices");
}

/// The text stays until the next text of this thread.
const char* kept(std::string text) {
  thread_local std::string last;
  last = std::move(text);
  return last.c_str();
}

}  // namespace

}  // namespace fclib::c

using namespace fclib;
using namespace fclib::c;

extern "C" {

fclib_options* fclib_options_create(void) {
  return guarded<fclib_options*>(nullptr, [] { return new fclib_options; });
}

void fclib_options_delete(fclib_options* options) { delete options; }

int fclib_options_set_text(fclib_options* options, const char* name, const char* value) {
  return guarded(0, [&] {
    given(options, "options").values[&given(name, "name")] = std::string(&given(value, "value"));
    return 1;
  });
}

int fclib_options_set_number(fclib_options* options, const char* name, double value) {
  return guarded(0, [&] {
    given(options, "options").values[&given(name, "name")] = text_of(value);
    return 1;
  });
}

int fclib_options_set_array(fclib_options* options, const char* name, const double* values,
                            int count) {
  return guarded(0, [&] {
    size_of(count, "count");
    given(options, "options").arrays[&given(name, "name")] = c::vector(values, count, "values");
    return 1;
  });
}

int fclib_options_set_progress(fclib_options* options, fclib_progress progress, void* context) {
  return guarded(0, [&] {
    given(options, "options").progress = progress;
    options->context = context;
    return 1;
  });
}

double fclib_report_number(const fclib_report* report, const char* name) {
  return guarded(std::numeric_limits<double>::quiet_NaN(),
                 [&] { return named(given(report, "report").numbers, name); });
}

const char* fclib_report_text(const fclib_report* report, const char* name) {
  return guarded<const char*>(nullptr,
                              [&] { return named(given(report, "report").texts, name).c_str(); });
}

const double* fclib_report_array(const fclib_report* report, const char* name, int* count) {
  if (count != nullptr) *count = 0;
  return guarded<const double*>(nullptr, [&] {
    const Vector& values = named(given(report, "report").arrays, name);
    given(count, "count") = static_cast<int>(values.size());
    static const double nothing = 0;  // an array without entries is not an error
    return values.size() > 0 ? values.data() : &nothing;
  });
}

void fclib_report_delete(fclib_report* report) { delete report; }

#define FCLIB_FUNCTIONS_OF(kind)                                                                  \
  fclib_report* fclib_solve_##kind##_with(const fclib_##kind* problem,                            \
                                          const fclib_options* options) {                         \
    return solve_with(problem, options);                                                          \
  }                                                                                               \
  fclib_report* fclib_judge_##kind(const fclib_##kind* problem, const fclib_solution* solution) { \
    return judge(problem, solution);                                                              \
  }

FCLIB_FOR_EACH_KIND(FCLIB_FUNCTIONS_OF)

#undef FCLIB_FUNCTIONS_OF

const char* fclib_solver_text(const char* solver, const char* what) {
  return guarded<const char*>(nullptr, [&]() -> const char* {
    const Solver& found = find_solver(&given(solver, "solver"));
    const std::string_view wanted = &given(what, "what");
    if (wanted == "title") return found.title.c_str();
    if (wanted == "family") return found.family.c_str();
    if (wanted == "citation") return found.citation.c_str();
    fail("solver", "has no '" + std::string(wanted) + "'; there are: title, family, citation");
  });
}

const char* fclib_option_text(const char* solver, int k, const char* what) {
  return guarded<const char*>(nullptr, [&]() -> const char* {
    const Solver& found = find_solver(&given(solver, "solver"));
    const std::string_view wanted = &given(what, "what");
    if (k < 0 || static_cast<std::size_t>(k) >= found.options.size()) return nullptr;
    return kept(option_text(found.options[static_cast<std::size_t>(k)], wanted));
  });
}

}  // extern "C"
