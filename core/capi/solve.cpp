// The functions of fclib.h that solve.
#include "solve/driver.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "capi/errors.hpp"
#include "capi/from_c.hpp"
#include "capi/status.hpp"

namespace fclib::c {

namespace {

/// "name=value name=value", separated by spaces, commas or semicolons. A value that contains one of
/// these stands in double quotes.
OptionValues parse_values(std::string_view list) {
  constexpr std::string_view separators = " \t\n,;";
  OptionValues values;
  for (;;) {
    const auto start = list.find_first_not_of(separators);
    if (start == std::string_view::npos) return values;
    list.remove_prefix(start);
    if (const auto at = list.find("=\""); at < list.find_first_of(separators)) {
      const auto end = list.find('"', at + 2);
      if (end == std::string_view::npos || at == 0) {
        throw Error(ErrorKind::option, "'" + std::string(list) + "' is not name=\"value\"",
                    "options");
      }
      values[std::string(list.substr(0, at))] = std::string(list.substr(at + 2, end - at - 2));
      list.remove_prefix(end + 1);
      continue;
    }
    const std::string_view pair = list.substr(0, list.find_first_of(separators));
    const auto equals = pair.find('=');
    if (equals == std::string_view::npos || equals == 0) {
      throw Error(ErrorKind::option, "'" + std::string(pair) + "' is not name=value", "options");
    }
    values[std::string(pair.substr(0, equals))] = std::string(pair.substr(equals + 1));
    list.remove_prefix(pair.size());
  }
}

template <class C>
int solve_problem(const C* c, const char* solver, const fclib_solve_options* options,
                  fclib_solution* solution, fclib_solve_result* result) {
  return guarded(0, [&] {
    const auto problem = problem_of(given(c, "problem"));
    fclib_solution& target = given(solution, "solution");
    if (problem.size(Dim::m) > 0) given(target.r, "solution->r");

    Settings settings;
    OptionValues values;
    Solution guess;
    if (options != nullptr) {
      if (!(options->tolerance >= 0)) fail("options->tolerance", "must not be negative");
      if (!(options->time_limit >= 0)) fail("options->time_limit", "must not be negative");
      size_of(options->max_iterations, "options->max_iterations");
      if (options->tolerance > 0) settings.tolerance = options->tolerance;
      if (options->time_limit > 0) settings.time_limit = options->time_limit;
      settings.max_iterations = options->max_iterations;
      if (options->options != nullptr) values = parse_values(options->options);
      if (options->guess != nullptr)
        guess.r = vector(options->guess, problem.size(Dim::m), "guess");
    }
    const Result solved = solve(problem, &given(solver, "solver"), settings, values, guess);

    for_each_member<fclib_solution>([&](const auto& field, double* fclib_solution::* member) {
      const Vector& from = solved.solution.*field.member;
      if (target.*member == nullptr || from.size() == 0) return;
      std::memcpy(target.*member, from.data(),
                  static_cast<std::size_t>(from.size()) * sizeof(double));
    });
    const auto fill = [](double* target, const Vector& from) {
      if (target != nullptr) std::copy(from.begin(), from.end(), target);
    };
    if (options != nullptr && solved.status == Status::infeasible) {
      fill(options->certificate_y, solved.certificate.y);
      fill(options->certificate_z, solved.certificate.z);
    }
    if (result != nullptr) {
      constexpr std::int64_t most = std::numeric_limits<int>::max();
      result->status = status_in_c(solved.status);
      result->iterations = static_cast<int>(std::min(solved.iterations, most));
      result->error = solved.error;
      result->cpu_s = solved.cpu_s;
      result->certificate_bound = solved.certificate.bound;
    }
    return 1;
  });
}

}  // namespace

}  // namespace fclib::c

using namespace fclib;
using namespace fclib::c;

extern "C" {

#define FCLIB_FUNCTIONS_OF(kind)                                                       \
  int fclib_solve_##kind(const fclib_##kind* problem, const char* solver,              \
                         const fclib_solve_options* options, fclib_solution* solution, \
                         fclib_solve_result* result) {                                 \
    return solve_problem(problem, solver, options, solution, result);                  \
  }

FCLIB_FOR_EACH_KIND(FCLIB_FUNCTIONS_OF)

#undef FCLIB_FUNCTIONS_OF

const char* fclib_solver_name(int k) {
  return guarded<const char*>(nullptr, [&]() -> const char* {
    const auto& all = solvers();
    if (k < 0 || static_cast<std::size_t>(k) >= all.size()) return nullptr;
    return all[static_cast<std::size_t>(k)]->name.c_str();
  });
}

const char* fclib_status_name(fclib_status status) {
  const int number = number_of(status);
  for (std::size_t k = 0; k < status_count; ++k) {
    const auto candidate = static_cast<Status>(k);
    if (status_in_c(candidate) == number) return name_of(candidate).data();  // a string literal
  }
  return "unknown";
}

}  // extern "C"
