// The C interface, include/fclib.h: structs to and from the core's, and nothing thrown across.
//
// A C struct lists its members by the names that the core's fields have; conversions walk the
// fields, so that none of them names a member.
#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <mutex>
#include <tuple>

#include "io/hdf5/hdf5.hpp"
#include "merit/merit.hpp"
#include "merit/merit_1.hpp"
#include "solve/driver.hpp"

// all else is hidden
#pragma GCC visibility push(default)
#include <fclib.h>
#pragma GCC visibility pop

namespace fclib {

namespace {

// ---- errors -----------------------------------------------------------------------------------

thread_local std::string last_error;

struct Handler {
  fclib_error_handler function = nullptr;
  void* context = nullptr;
};

std::mutex handler_mutex;
Handler handler;

void report(const char* message) noexcept {
  try {
    last_error = message;
    Handler current;
    {
      const std::lock_guard lock(handler_mutex);
      current = handler;
    }
    // a copy: the handler may call the library
    const std::string text = last_error;
    if (current.function != nullptr) {
      current.function(text.c_str(), current.context);
      last_error = text;
    }
  } catch (...) {
    // a C++ handler that throws, or no memory for the message: there is nobody left to tell
    last_error.clear();
  }
}

/// What body() returns, or `failure` with the message kept.
template <class Result, class Body>
Result guarded(Result failure, const Body& body) noexcept {
  last_error.clear();
  try {
    return body();
  } catch (const std::bad_alloc&) {
    report("there is not enough memory");
  } catch (const std::exception& error) {
    report(error.what());
  } catch (...) {
    report("an unknown error");
  }
  return failure;
}

[[noreturn]] void fail(const std::string& where, const std::string& message) {
  throw Error(ErrorKind::problem, message, where);
}

template <class T>
T& given(T* pointer, const char* name) {
  if (pointer == nullptr) fail(name, "is NULL");
  return *pointer;
}

// ---- settings of the process ------------------------------------------------------------------

std::atomic<bool> replace{false};
std::atomic<int> compression{WriteOptions{}.compression};

/// 3.1 checks no value and converts no matrix.
WriteOptions write_options() {
  return {.validate = false, .replace = replace, .compression = compression};
}

// ---- the members of the structs ---------------------------------------------------------------

template <class Struct, class Type>
struct Member {
  std::string_view name;
  Type Struct::* pointer;
};

/// The core's struct for a C struct, and the members of the latter.
template <class Struct>
struct Twin;

#define MEMBER(name) \
  Member { #name, &C::name }

template <>
struct Twin<fclib_local> {
  using C = fclib_local;
  using Core = LocalProblem;
  static constexpr std::tuple members{MEMBER(spacedim), MEMBER(W),  MEMBER(V), MEMBER(R),
                                      MEMBER(q),        MEMBER(mu), MEMBER(s)};
};
template <>
struct Twin<fclib_local_rolling> {
  using C = fclib_local_rolling;
  using Core = LocalRollingProblem;
  static constexpr std::tuple members{MEMBER(spacedim), MEMBER(W),  MEMBER(V),    MEMBER(R),
                                      MEMBER(q),        MEMBER(mu), MEMBER(mu_r), MEMBER(s)};
};
template <>
struct Twin<fclib_global> {
  using C = fclib_global;
  using Core = GlobalProblem;
  static constexpr std::tuple members{MEMBER(spacedim), MEMBER(M), MEMBER(H),  MEMBER(G),
                                      MEMBER(f),        MEMBER(w), MEMBER(mu), MEMBER(b)};
};
template <>
struct Twin<fclib_global_rolling> {
  using C = fclib_global_rolling;
  using Core = GlobalRollingProblem;
  static constexpr std::tuple members{MEMBER(spacedim), MEMBER(M),    MEMBER(H),
                                      MEMBER(G),        MEMBER(f),    MEMBER(w),
                                      MEMBER(mu),       MEMBER(mu_r), MEMBER(b)};
};
template <>
struct Twin<fclib_solution> {
  using C = fclib_solution;
  using Core = Solution;
  static constexpr std::tuple members{MEMBER(v), MEMBER(u), MEMBER(r), MEMBER(l)};
};
template <>
struct Twin<fclib_info> {
  using C = fclib_info;
  using Core = ProblemInfo;
  static constexpr std::tuple members{MEMBER(title), MEMBER(description), MEMBER(math_info)};
};

#undef MEMBER

/// How a member of the core's structs looks in C.
template <class Type>
struct InC;
template <>
struct InC<Index> {
  using type = int;
};
template <>
struct InC<Matrix> {
  using type = fclib_matrix*;
};
template <>
struct InC<Vector> {
  using type = double*;
};
template <>
struct InC<std::string> {
  using type = char*;
};

/// Calls visit(field, member) for each field of the core's struct and its member of the C struct.
template <class C, class Visitor>
void for_each_member(const Visitor& visit) {
  using Core = typename Twin<C>::Core;
  static_assert(std::tuple_size_v<decltype(Core::fields())> ==
                std::tuple_size_v<std::remove_cvref_t<decltype(Twin<C>::members)>>);
  for_each_field<Core>([&]<class Type>(const Field<Core, Type>& field) {
    const auto match = [&]<class CType>(const Member<C, CType>& member) {
      if constexpr (std::is_same_v<CType, typename InC<Type>::type>) {
        if (member.name == field.name) visit(field, member.pointer);
      }
    };
    std::apply([&](const auto&... member) { (match(member), ...); }, Twin<C>::members);
  });
}

// ---- from C -----------------------------------------------------------------------------------

std::size_t size_of(int count, const std::string& where) {
  if (count < 0) fail(where, "is " + std::to_string(count) + ", but must not be negative");
  return static_cast<std::size_t>(count);
}

template <class Number>
std::vector<Number> numbers(const Number* values, std::size_t size, const std::string& where) {
  if (size == 0) return {};
  if (values == nullptr) fail(where, "is NULL, but has " + std::to_string(size) + " entries");
  return {values, values + size};
}

Vector vector(const double* values, Index size, const std::string& where) {
  if (size == 0) return {};
  if (values == nullptr) fail(where, "is NULL, but has " + std::to_string(size) + " entries");
  return Eigen::Map<const Vector>(values, size);
}

std::string text(const char* value) { return value != nullptr ? std::string(value) : absent_text; }

Matrix matrix(const fclib_matrix& c, const std::string& where) {
  Matrix a;
  a.rows = c.m;
  a.cols = c.n;
  const std::size_t rows = size_of(c.m, where + "/m");
  const std::size_t cols = size_of(c.n, where + "/n");
  std::size_t entries = size_of(c.nzmax, where + "/nzmax");
  if (c.nz >= 0) {
    a.storage = Storage::triplet;
    entries = static_cast<std::size_t>(c.nz);
    a.p = numbers(c.p, entries, where + "/p");
  } else if (c.nz == -1 || c.nz == -2) {
    a.storage = c.nz == -1 ? Storage::csc : Storage::csr;
    a.p = numbers(c.p, (c.nz == -1 ? cols : rows) + 1, where + "/p");
  } else if (c.nz == -3) {
    a.storage = Storage::dense;
    entries = rows * cols;
  } else {
    fail(where + "/nz", std::to_string(c.nz) + " is no storage");
  }
  if (a.storage != Storage::dense) a.i = numbers(c.i, entries, where + "/i");
  a.x = numbers(c.x, entries, where + "/x");
  if (c.info != nullptr) {
    a.info = MatrixInfo{.comment = text(c.info->comment),
                        .conditioning = c.info->conditioning,
                        .determinant = c.info->determinant,
                        .rank = c.info->rank};
  }
  return a;
}

/// The problem as it is, unchecked but for what its own sizes need.
template <class C>
auto problem_as_given(const C& c) {
  using P = typename Twin<C>::Core;
  const std::string group = "/" + group_name<P>() + "/";
  P problem;
  // the matrices say how long the vectors are
  std::string there;
  std::string missing;
  for_each_member<C>([&]<class Type, class Pointer>(const Field<P, Type>& field, Pointer member) {
    if constexpr (std::is_same_v<Type, Index>) {
      problem.*field.member = c.*member;
    } else if constexpr (std::is_same_v<Type, Matrix>) {
      const std::string where = group + field_path(field);
      if (field.presence == Presence::mixed) {
        (c.*member != nullptr ? there : missing) = where;
        if (c.*member == nullptr) return;
      }
      problem.*field.member = matrix(given(c.*member, where.c_str()), where);
    }
  });
  if (!there.empty() && !missing.empty()) fail(missing, "is NULL, but " + there + " is not");
  const auto [planar, spatial] = P::dimensions;
  if (c.spacedim != planar && c.spacedim != spatial) {
    fail(group + "spacedim", "is " + std::to_string(c.spacedim) + ", but must be " +
                                 std::to_string(planar) + " or " + std::to_string(spatial));
  }
  count_contacts(problem);
  for_each_member<C>([&]<class Type, class Pointer>(const Field<P, Type>& field, Pointer member) {
    if constexpr (std::is_same_v<Type, Vector>) {
      problem.*field.member =
          vector(c.*member, problem.size(field.rows), group + field_path(field));
    }
  });
  problem.info = {absent_text, absent_text, absent_text};
  if (c.info != nullptr) {
    for_each_member<fclib_info>([&](const auto& field, char* fclib_info::* member) {
      problem.info.*field.member = text(c.info->*member);
    });
  }
  return problem;
}

/// The problem, valid, without the room that nzmax leaves.
template <class C>
auto valid_problem(const C& c) {
  using P = typename Twin<C>::Core;
  P problem = problem_as_given(c);
  for_each_field<P>([&]<class Type>(const Field<P, Type>& field) {
    if constexpr (std::is_same_v<Type, Matrix>) {
      Matrix& a = problem.*field.member;
      const bool compressed = a.storage == Storage::csc || a.storage == Storage::csr;
      if (!compressed || a.p.empty() || a.p.back() < 0) return;
      const auto entries = static_cast<std::size_t>(a.p.back());
      a.i.resize(std::min(a.i.size(), entries));
      a.x.resize(std::min(a.x.size(), entries));
    }
  });
  validate(problem);
  return problem;
}

enum class Parts { all, some };

/// The solution of a problem; with Parts::some v and u may be missing.
template <class P>
Solution solution_of(const fclib_solution& c, const P& problem, Parts parts) {
  Solution solution;
  for_each_member<fclib_solution>([&](const auto& field, double* fclib_solution::* member) {
    if (parts == Parts::some && field.presence == Presence::optional && c.*member == nullptr) {
      return;
    }
    solution.*field.member =
        vector(c.*member, problem.size(field.rows), "/solution/" + std::string(field.name));
  });
  return solution;
}

// ---- to C -------------------------------------------------------------------------------------

void free_members(fclib_matrix& a) {
  std::free(a.p);
  std::free(a.i);
  std::free(a.x);
  if (a.info != nullptr) std::free(a.info->comment);
  std::free(a.info);
}

template <class C>
void free_members(C& c) {
  for_each_member<C>([&]<class Pointer>(const auto&, Pointer member) {
    using Type = std::remove_reference_t<decltype(c.*member)>;
    if constexpr (std::is_same_v<Type, fclib_matrix*>) {
      if (c.*member != nullptr) free_members(*(c.*member));
    }
    if constexpr (std::is_pointer_v<Type>) std::free(c.*member);
  });
  if constexpr (requires { c.info; }) {
    if (c.info != nullptr) free_members(*c.info);
    std::free(c.info);
  }
}

struct Free {
  template <class C>
  void operator()(C* c) const {
    free_members(*c);
    std::free(c);
  }
};

/// A C struct of zeros that frees itself and its members unless it is released.
template <class C>
using Owned = std::unique_ptr<C, Free>;

template <class T>
T* allocate(std::size_t count) {
  auto* memory = static_cast<T*>(std::calloc(std::max<std::size_t>(count, 1), sizeof(T)));
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

double* copy_vector(const Vector& values) {
  const auto size = static_cast<std::size_t>(values.size());
  MallocArray<double> result(size);
  if (size > 0) std::memcpy(result.data(), values.data(), size * sizeof(double));
  return result.release();
}

char* copy_text(const std::string& value) {
  if (value == absent_text) return nullptr;
  auto* result = allocate<char>(value.size() + 1);
  std::memcpy(result, value.c_str(), value.size());
  return result;
}

fclib_matrix* to_c(RawMatrix& a) {
  Owned<fclib_matrix> c(allocate<fclib_matrix>(1));
  c->nzmax = static_cast<int>(a.x.size());
  c->m = a.rows;
  c->n = a.cols;
  switch (a.storage) {
    case Storage::triplet:
      c->nz = static_cast<int>(a.x.size());
      break;
    case Storage::csc:
      c->nz = -1;
      break;
    case Storage::csr:
      c->nz = -2;
      break;
    case Storage::dense:
      c->nz = -3;
      break;
  }
  if (a.storage != Storage::dense) {
    c->p = a.p.release();
    c->i = a.i.release();
  }
  c->x = a.x.release();
  if (a.info) {
    c->info = allocate<fclib_matrix_info>(1);
    c->info->comment = copy_text(a.info->comment);
    c->info->conditioning = a.info->conditioning;
    c->info->determinant = a.info->determinant;
    c->info->rank = a.info->rank;
  }
  return c.release();
}

/// The arrays of the problem become those of the C struct.
template <class C>
C* to_c(RawProblem& problem) {
  Owned<C> c(allocate<C>(1));
  for (auto& [name, value] : problem.members) {
    for_each_member<C>([&]<class Field, class Pointer>(const Field& field, Pointer member) {
      if (field.name != name) return;
      using CType = std::remove_reference_t<decltype((*c).*member)>;
      if constexpr (std::is_same_v<CType, int>) {
        (*c).*member = std::get<Index>(value);
      } else if constexpr (std::is_same_v<CType, fclib_matrix*>) {
        (*c).*member = to_c(std::get<RawMatrix>(value));
      } else {
        (*c).*member = std::get<MallocArray<double>>(value).release();
      }
    });
  }
  Owned<fclib_info> info(allocate<fclib_info>(1));
  bool informed = false;
  for_each_member<fclib_info>([&](const auto& field, char* fclib_info::* member) {
    (*info).*member = copy_text(problem.info.*field.member);
    informed = informed || (*info).*member != nullptr;
  });
  if (informed) c->info = info.release();
  return c.release();
}

/// Fills the members of a solution from a file, whose sizes are those of its problem.
void to_c(const Solution& solution, const Problem& outline, const std::string& where,
          fclib_solution& c) {
  for_each_member<fclib_solution>([&](const auto& field, double* fclib_solution::* member) {
    const Index size = std::visit([&](const auto& p) { return p.size(field.rows); }, outline);
    const Vector& values = solution.*field.member;
    if (values.size() != size) {
      fail(where + "/" + std::string(field.name),
           "has " + std::to_string(values.size()) + " entries, expected " + std::to_string(size));
    }
    const bool absent = field.presence != Presence::required && size == 0;
    if (!absent) c.*member = copy_vector(values);
  });
}

// ---- what the functions do --------------------------------------------------------------------

template <class C>
int write_problem(const C* c, const char* path) {
  return guarded(0, [&] {
    const auto problem = problem_as_given(given(c, "problem"));
    WriteOptions options = write_options();
    options.append = true;
    write_file(&given(path, "path"), &problem, nullptr, {}, options);
    return 1;
  });
}

template <class C>
C* read_c(const char* path) {
  return guarded<C*>(nullptr, [&] {
    using P = typename Twin<C>::Core;
    RawProblem problem = read_raw_problem(&given(path, "path"), P::kind);
    return to_c<C>(problem);
  });
}

template <class C>
void delete_members(C* c) {
  if (c == nullptr) return;
  free_members(*c);
  *c = C{};
}

template <class C>
int validate_problem(const C* c) {
  return guarded(0, [&] {
    valid_problem(given(c, "problem"));
    return 1;
  });
}

template <class C>
int validate_solution(const C* c, const fclib_solution* solution) {
  return guarded(0, [&] {
    const auto problem = problem_as_given(given(c, "problem"));
    validate(solution_of(given(solution, "solution"), problem, Parts::some), problem);
    return 1;
  });
}

template <class C>
double merit_of(const C* c, fclib_merit kind, const fclib_solution* solution) {
  return guarded(std::numeric_limits<double>::quiet_NaN(), [&] {
    const auto problem = valid_problem(given(c, "problem"));
    const Solution candidate = solution_of(given(solution, "solution"), problem, Parts::some);
    switch (kind) {
      case MERIT_1:
        return merit_1(problem, candidate);
      case MERIT_2:
        return merit(problem, candidate).error;
    }
    fail("merit", std::to_string(static_cast<int>(kind)) + " is no merit");
  });
}

/// "name=value name=value", separated by spaces, commas or semicolons.
OptionValues parse_values(std::string_view list) {
  constexpr std::string_view separators = " \t\n,;";
  OptionValues values;
  for (;;) {
    const auto start = list.find_first_not_of(separators);
    if (start == std::string_view::npos) return values;
    list.remove_prefix(start);
    const std::string_view pair = list.substr(0, list.find_first_of(separators));
    const auto equals = pair.find('=');
    if (equals == std::string_view::npos || equals == 0) {
      throw Error(ErrorKind::option, "'" + std::string(pair) + "' is not name=value", "options");
    }
    values[std::string(pair.substr(0, equals))] = std::string(pair.substr(equals + 1));
    list.remove_prefix(pair.size());
  }
}

fclib_status status_in_c(Status status) {
  switch (status) {
    case Status::converged:
      return FCLIB_CONVERGED;
    case Status::iteration_limit:
      return FCLIB_ITERATION_LIMIT;
    case Status::time_limit:
      return FCLIB_TIME_LIMIT;
    case Status::diverged:
      return FCLIB_DIVERGED;
    case Status::inaccurate:
      return FCLIB_INACCURATE;
    case Status::interrupted:
      return FCLIB_INTERRUPTED;
    case Status::stalled:
      return FCLIB_STALLED;
    case Status::infeasible:
      return FCLIB_INFEASIBLE;
  }
  return FCLIB_DIVERGED;
}

template <class C>
int solve_problem(const C* c, const char* solver, const fclib_solve_options* options,
                  fclib_solution* solution, fclib_solve_result* result) {
  return guarded(0, [&] {
    const auto problem = valid_problem(given(c, "problem"));
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
    if (result != nullptr) {
      constexpr std::int64_t most = std::numeric_limits<int>::max();
      result->status = status_in_c(solved.status);
      result->iterations = static_cast<int>(std::min(solved.iterations, most));
      result->error = solved.error;
      result->cpu_s = solved.cpu_s;
    }
    return 1;
  });
}

}  // namespace

}  // namespace fclib

// ---- the interface ----------------------------------------------------------------------------

using namespace fclib;

extern "C" {

#define FCLIB_FUNCTIONS_OF(kind)                                                                  \
  int fclib_write_##kind(fclib_##kind* problem, const char* path) {                               \
    return write_problem(problem, path);                                                          \
  }                                                                                               \
  fclib_##kind* fclib_read_##kind(const char* path) { return read_c<fclib_##kind>(path); }        \
  void fclib_delete_##kind(fclib_##kind* problem) { delete_members(problem); }                    \
  int fclib_validate_##kind(const fclib_##kind* problem) { return validate_problem(problem); }    \
  int fclib_validate_##kind##_solution(const fclib_##kind* problem,                               \
                                       const fclib_solution* solution) {                          \
    return validate_solution(problem, solution);                                                  \
  }                                                                                               \
  double fclib_merit_##kind(fclib_##kind* problem, fclib_merit merit, fclib_solution* solution) { \
    return merit_of(problem, merit, solution);                                                    \
  }                                                                                               \
  int fclib_solve_##kind(const fclib_##kind* problem, const char* solver,                         \
                         const fclib_solve_options* options, fclib_solution* solution,            \
                         fclib_solve_result* result) {                                            \
    return solve_problem(problem, solver, options, solution, result);                             \
  }

FCLIB_FUNCTIONS_OF(global)
FCLIB_FUNCTIONS_OF(local)
FCLIB_FUNCTIONS_OF(global_rolling)
FCLIB_FUNCTIONS_OF(local_rolling)

#undef FCLIB_FUNCTIONS_OF

int fclib_write_solution(fclib_solution* solution, const char* path) {
  return guarded(0, [&] {
    const Problem outline = read_outline(&given(path, "path"));
    const Solution whole = std::visit(
        [&](const auto& p) { return solution_of(given(solution, "solution"), p, Parts::all); },
        outline);
    write_solution(path, whole, write_options());
    return 1;
  });
}

int fclib_write_guesses(int number_of_guesses, fclib_solution* guesses, const char* path) {
  return guarded(0, [&] {
    const Problem outline = read_outline(&given(path, "path"));
    const std::size_t count = size_of(number_of_guesses, "number_of_guesses");
    if (count > 0) given(guesses, "guesses");
    std::vector<Solution> all;
    for (std::size_t k = 0; k < count; ++k) {
      all.push_back(std::visit(
          [&](const auto& p) { return solution_of(guesses[k], p, Parts::all); }, outline));
    }
    write_guesses(path, all, write_options());
    return 1;
  });
}

fclib_solution* fclib_read_solution(const char* path) {
  return guarded<fclib_solution*>(nullptr, [&] {
    auto solution = read_solution(&given(path, "path"));
    if (!solution) throw Error(ErrorKind::file, "holds no solution", "/", path);
    Owned<fclib_solution> c(allocate<fclib_solution>(1));
    to_c(*solution, read_outline(path), std::string(path) + ": /solution", *c);
    return c.release();
  });
}

fclib_solution* fclib_read_guesses(const char* path, int* number_of_guesses) {
  if (number_of_guesses != nullptr) *number_of_guesses = 0;
  return guarded<fclib_solution*>(nullptr, [&] {
    int& number = given(number_of_guesses, "number_of_guesses");
    auto guesses = read_guesses(&given(path, "path"));
    if (guesses.empty()) throw Error(ErrorKind::file, "holds no guesses", "/", path);
    const Problem outline = read_outline(path);
    const int count = static_cast<int>(guesses.size());
    const auto release = [&](fclib_solution* array) { fclib_delete_solutions(array, count); };
    std::unique_ptr<fclib_solution, decltype(release)> array(
        allocate<fclib_solution>(guesses.size()), release);
    for (std::size_t k = 0; k < guesses.size(); ++k) {
      to_c(guesses[k], outline, std::string(path) + ": /guesses/" + std::to_string(k + 1),
           array.get()[k]);
    }
    number = count;
    return array.release();
  });
}

void fclib_delete_solutions(fclib_solution* data, int count) {
  if (data == nullptr) return;
  for (int k = 0; k < count; ++k) free_members(data[k]);
  std::free(data);
}

int fclib_create_int_attributes_in_info(const char* path, const char* attr_name, int attr_value) {
  return guarded(0, [&] {
    write_int_attribute(&given(path, "path"), &given(attr_name, "attr_name"), attr_value,
                        write_options());
    return 1;
  });
}

const char* fclib_problem_kind(const char* path) {
  return guarded<const char*>(nullptr, [&] {
    const Problem outline = read_outline(&given(path, "path"));
    // the kinds are literals
    return std::visit([]<class P>(const P&) { return P::kind.data(); }, outline);
  });
}

int fclib_set_write_mode(fclib_write_mode mode) {
  return guarded(0, [&] {
    if (mode != FCLIB_WRITE_ADD && mode != FCLIB_WRITE_REPLACE) {
      fail("write mode", std::to_string(static_cast<int>(mode)) + " is none");
    }
    replace = mode == FCLIB_WRITE_REPLACE;
    return 1;
  });
}

int fclib_set_compression(int level) {
  return guarded(0, [&] {
    if (level < 0 || level > 9) {
      fail("compression level", std::to_string(level) + " is outside 0..9");
    }
    compression = level;
    return 1;
  });
}

const char* fclib_last_error(void) { return last_error.c_str(); }

void fclib_set_error_handler(fclib_error_handler function, void* context) {
  const std::lock_guard lock(handler_mutex);
  handler = {function, context};
}

const char* fclib_solver_name(int k) {
  return guarded<const char*>(nullptr, [&]() -> const char* {
    const auto& all = solvers();
    if (k < 0 || static_cast<std::size_t>(k) >= all.size()) return nullptr;
    return all[static_cast<std::size_t>(k)]->name.c_str();
  });
}

const char* fclib_status_name(fclib_status status) {
  for (const Status candidate :
       {Status::converged, Status::iteration_limit, Status::time_limit, Status::diverged,
        Status::inaccurate, Status::interrupted, Status::stalled}) {
    if (status_in_c(candidate) == status) return name_of(candidate).data();  // a literal
  }
  return "unknown";
}

}  // extern "C"
