// fclib.hpp: fclib.h in the style of C++20. What a read returns frees itself, arrays are std::span,
// and a failed call throws fclib::Error.
//
//   const auto problem = fclib::read<fclib_local>("problem.hdf5");
//   const fclib::Result result = fclib::solve(*problem, "auto", {.tolerance = 1e-10});
//   for (const double component : result.solution.r) ...
//
// It needs only fclib.h and the library. Their functions and structs may be used beside it. If a
// call fails, the library prints a line on the standard error, as libfclib 3.1 did. After
// fclib_set_error_handler(nullptr, nullptr) there is only the exception.
#pragma once

#if !defined(__cplusplus) || \
    (__cplusplus < 202002L && (!defined(_MSVC_LANG) || _MSVC_LANG < 202002L))
#error "fclib.hpp needs C++20; fclib.h can be used from any C++"
#endif

#include <fclib.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <exception>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace fclib {
// the library has an inner namespace of the same name: no symbol may collide with one of a static
// library
inline namespace facade {

/// A call that failed: the library's message.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Throws the message of this thread's call that has just failed.
[[noreturn]] inline void fail() { throw Error(fclib_last_error()); }

/// The result of a call. Throws if it is 0 or NULL.
template <class Value>
Value checked(Value value) {
  if (!value) fail();
  return value;
}

// ---- problems

/// The functions of fclib.h for a struct.
template <class C>
struct Calls;

#define FCLIB_CALLS(kind)                                     \
  template <>                                                 \
  struct Calls<fclib_##kind> {                                \
    static constexpr std::string_view name = #kind;           \
    static constexpr auto read = fclib_read_##kind;           \
    static constexpr auto write = fclib_write_##kind;         \
    static constexpr auto add = fclib_sequence_add_##kind;    \
    static constexpr auto free_members = fclib_delete_##kind; \
    static constexpr auto validate = fclib_validate_##kind;   \
    static constexpr auto merit = fclib_merit_##kind;         \
    static constexpr auto solve = fclib_solve_##kind##_with;  \
  };
FCLIB_CALLS(global)
FCLIB_CALLS(local)
FCLIB_CALLS(global_rolling)
FCLIB_CALLS(local_rolling)
FCLIB_CALLS(global_spin)
FCLIB_CALLS(local_spin)
#undef FCLIB_CALLS

/// fclib_global, fclib_local, fclib_global_rolling, fclib_local_rolling, fclib_global_spin,
/// fclib_local_spin.
template <class C>
concept Problem = requires { Calls<std::remove_cv_t<C>>::name; };

/// Frees what a read returns.
struct Delete {
  template <Problem C>
  void operator()(C* problem) const {
    Calls<C>::free_members(problem);
    std::free(problem);
  }
};

/// A problem that was read.
template <Problem C>
using Owned = std::unique_ptr<C, Delete>;

/// The lengths that the arrays of a problem have.
struct Sizes {
  std::size_t n = 0;   ///< degrees of freedom, 0 for a local problem
  std::size_t m = 0;   ///< components of the contacts
  std::size_t p = 0;   ///< bilateral constraints
  std::size_t nc = 0;  ///< contacts
};

template <Problem C>
Sizes sizes(const C& problem) {
  const auto of = [](const fclib_matrix* a, int fclib_matrix::* side) {
    return a != nullptr && a->*side > 0 ? static_cast<std::size_t>(a->*side) : 0;
  };
  Sizes all;
  if constexpr (requires { problem.W; }) {
    all.m = of(problem.W, &fclib_matrix::m);
    all.p = of(problem.V, &fclib_matrix::n);
  } else {
    all.n = of(problem.M, &fclib_matrix::m);
    all.m = of(problem.H, &fclib_matrix::n);
    all.p = of(problem.G, &fclib_matrix::n);
  }
  if (problem.spacedim > 0) all.nc = all.m / static_cast<std::size_t>(problem.spacedim);
  return all;
}

/// The arrays of a problem, as spans of the lengths they have: fclib::mu(*problem).
#define FCLIB_SPAN(member, size)                                                               \
  template <Problem C>                                                                         \
    requires requires(C problem) { problem.member; }                                           \
  auto member(C& problem) {                                                                    \
    using Number = std::conditional_t<std::is_const_v<C>, const double, double>;               \
    return problem.member == nullptr ? std::span<Number>()                                     \
                                     : std::span<Number>(problem.member, sizes(problem).size); \
  }
FCLIB_SPAN(mu, nc)
FCLIB_SPAN(mu_r, nc)
FCLIB_SPAN(mu_s, nc)
FCLIB_SPAN(q, m)
FCLIB_SPAN(s, p)
FCLIB_SPAN(f, n)
FCLIB_SPAN(w, m)
FCLIB_SPAN(b, p)
#undef FCLIB_SPAN

/// Throws if the data of a problem makes no sense.
template <Problem C>
void validate(const C& problem) {
  checked(Calls<C>::validate(&problem));
}

// ---- matrices of the caller's numbers, which must outlive them; the library does not change them

namespace detail {

inline int count(std::size_t size) {
  if (size > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
    throw Error("an array has more entries than an int counts");
  }
  return static_cast<int>(size);
}

template <class Number>
Number* pointer(std::span<const Number> values) {
  return const_cast<Number*>(values.data());
}

inline void require_size(std::string_view name, std::size_t size, std::size_t expected) {
  if (size == expected) return;
  throw Error(std::string(name) + " has " + std::to_string(size) + " entries, expected " +
              std::to_string(expected));
}

inline fclib_matrix matrix(int m, int n, int nz, std::span<const int> p, std::span<const int> i,
                           std::span<const double> x) {
  if (m < 0 || n < 0) throw Error("a matrix has a negative number of rows or columns");
  return {count(x.size()), m, n, pointer(p), pointer(i), pointer(x), nz, nullptr};
}

inline fclib_matrix compressed(int m, int n, int nz, std::span<const int> starts,
                               std::span<const int> i, std::span<const double> x) {
  fclib_matrix a = matrix(m, n, nz, starts, i, x);
  require_size("starts", starts.size(), static_cast<std::size_t>(nz == -1 ? n : m) + 1);
  require_size("the indices", i.size(), x.size());
  return a;
}

}  // namespace detail

/// Dense; the numbers are by columns.
inline fclib_matrix dense(int m, int n, std::span<const double> x) {
  fclib_matrix a = detail::matrix(m, n, -3, {}, {}, x);
  detail::require_size("a dense matrix", x.size(),
                       static_cast<std::size_t>(m) * static_cast<std::size_t>(n));
  return a;
}

/// Compressed columns: the start of each column (n + 1), the rows of the entries.
inline fclib_matrix columns(int m, int n, std::span<const int> starts, std::span<const int> rows,
                            std::span<const double> x) {
  return detail::compressed(m, n, -1, starts, rows, x);
}

/// Compressed rows: the start of each row (m + 1), the columns of the entries.
inline fclib_matrix rows(int m, int n, std::span<const int> starts, std::span<const int> columns,
                         std::span<const double> x) {
  return detail::compressed(m, n, -2, starts, columns, x);
}

/// Triplets. Those at one place add up.
inline fclib_matrix triplets(int m, int n, std::span<const int> rows, std::span<const int> columns,
                             std::span<const double> x) {
  fclib_matrix a = detail::matrix(m, n, detail::count(x.size()), columns, rows, x);
  detail::require_size("the rows", rows.size(), x.size());
  detail::require_size("the columns", columns.size(), x.size());
  return a;
}

// ---- solutions

/// A solution, or a guess, with its arrays. An empty array is not given.
struct Solution {
  Solution() = default;
  explicit Solution(const Sizes& size) : v(size.n), u(size.m), r(size.m), l(size.p) {}

  /// The struct that the library takes. It is valid as long as the arrays are.
  [[nodiscard]] fclib_solution view() const {
    const auto array = [](const std::vector<double>& x) {
      return x.empty() ? nullptr : const_cast<double*>(x.data());
    };
    return {array(v), array(u), array(r), array(l)};
  }

  std::vector<double> v, u, r, l;
};

namespace detail {

/// Checks the lengths: the library reads as many numbers as the problem says.
inline void require_sizes(const Solution& solution, const Sizes& size) {
  const auto require = [](const char* name, const std::vector<double>& x, std::size_t expected) {
    if (!x.empty()) require_size(name, x.size(), expected);
  };
  require("v", solution.v, size.n);
  require("u", solution.u, size.m);
  require("r", solution.r, size.m);
  require("l", solution.l, size.p);
}

}  // namespace detail

/// MERIT_2, which every tolerance bounds, or MERIT_1, the merit of libfclib 3.1.
template <Problem C>
double merit(const C& problem, const Solution& solution, fclib_merit kind = MERIT_2) {
  detail::require_sizes(solution, sizes(problem));
  fclib_solution view = solution.view();
  const double value = Calls<C>::merit(const_cast<C*>(&problem), kind, &view);
  if (value != value) fail();
  return value;
}

// ---- files

namespace detail {

/// A text as C takes it. Throws if C would take only a part of it.
inline const char* text(const char* name, const std::string& value) {
  if (const std::size_t end = value.find('\0'); end != std::string::npos) {
    throw Error(std::string(name) + " has a zero byte, at " + std::to_string(end) +
                ", where C would cut it: " + value.c_str());
  }
  return value.c_str();
}

}  // namespace detail

template <Problem C>
Owned<C> read(const std::string& path) {
  return Owned<C>(checked(Calls<C>::read(detail::text("a path", path))));
}

/// Adds the problem to a file. fclib_set_write_mode() says what happens to one that is there
/// already.
template <Problem C>
void write(const std::string& path, const C& problem) {
  checked(Calls<C>::write(const_cast<C*>(&problem), detail::text("a path", path)));
}

/// "global", "local", ...: the problem that the solution of the file belongs to.
inline std::string_view kind(const std::string& path) {
  return checked(fclib_problem_kind(detail::text("a path", path)));
}

namespace detail {

inline Sizes sizes_in(const std::string& path) {
  int n = 0;
  int m = 0;
  int p = 0;
  int nc = 0;
  checked(fclib_problem_sizes(detail::text("a path", path), &n, &m, &p, &nc));
  return {static_cast<std::size_t>(n), static_cast<std::size_t>(m), static_cast<std::size_t>(p),
          static_cast<std::size_t>(nc)};
}

inline Solution copied(const fclib_solution& from, const Sizes& size) {
  const auto array = [](const double* x, std::size_t count) {
    return x == nullptr ? std::vector<double>() : std::vector<double>(x, x + count);
  };
  Solution solution;
  solution.v = array(from.v, size.n);
  solution.u = array(from.u, size.m);
  solution.r = array(from.r, size.m);
  solution.l = array(from.l, size.p);
  return solution;
}

/// Solutions as fclib_read_guesses() returns them.
struct Array {
  fclib_solution* data = nullptr;
  int count = 0;

  Array(fclib_solution* from, int size) : data(from), count(size) {}
  Array(const Array&) = delete;
  Array& operator=(const Array&) = delete;
  ~Array() { fclib_delete_solutions(data, count); }
};

}  // namespace detail

/// The solution in a file. Throws if there is none.
inline Solution read_solution(const std::string& path) {
  const Sizes size = detail::sizes_in(path);
  const detail::Array found(checked(fclib_read_solution(detail::text("a path", path))), 1);
  return detail::copied(*found.data, size);
}

/// Adds a solution of the problem that is in the file. Missing members are completed, as
/// fclib_write_solution() says.
inline void write_solution(const std::string& path, const Solution& solution) {
  detail::require_sizes(solution, detail::sizes_in(path));
  fclib_solution view = solution.view();
  checked(fclib_write_solution(&view, detail::text("a path", path)));
}

/// The guesses in a file, if there are any.
inline std::vector<Solution> read_guesses(const std::string& path) {
  const Sizes size = detail::sizes_in(path);
  int count = 0;
  fclib_solution* const first = fclib_read_guesses(detail::text("a path", path), &count);
  if (first == nullptr && *fclib_last_error() != '\0') fail();
  const detail::Array found(first, count);
  std::vector<Solution> guesses;
  for (const auto& guess : std::span(found.data, static_cast<std::size_t>(found.count))) {
    guesses.push_back(detail::copied(guess, size));
  }
  return guesses;
}

/// Adds guesses for the problem that is in the file.
inline void write_guesses(const std::string& path, std::span<const Solution> guesses) {
  const Sizes size = detail::sizes_in(path);
  std::vector<fclib_solution> views;
  for (const Solution& guess : guesses) {
    detail::require_sizes(guess, size);
    views.push_back(guess.view());
  }
  checked(
      fclib_write_guesses(detail::count(views.size()), views.data(), detail::text("a path", path)));
}

// ---- pictures

/// Where the contacts of a problem are, and the bodies that touch there: the members of
/// fclib_geometry as spans by rows. An empty span is not given.
struct Geometry {
  // of each contact
  std::span<const int> body{};        ///< (nc x 2) the normal points from the first to the second
  std::span<const int> shape{};       ///< (nc x 2) or none: the first shape of each body
  std::span<const int> feature{};     ///< (nc) or none
  std::span<const double> point{};    ///< (nc x 3)
  std::span<const double> normal{};   ///< (nc x 3)
  std::span<const double> tangent{};  ///< (nc x 3)
  std::span<const double> gap{};      ///< (nc) or none
  // of each body
  std::span<const std::string> name{};  ///< (nb) or none
  std::span<const int> moves{};         ///< (nb) 1 or 0
  std::span<const double> place{};      ///< (nb x 3)
  std::span<const double> turn{};       ///< (nb x 4) or none
  // of each shape
  std::span<const int> shape_body{};      ///< (ns) or none: shape k is that of body k
  std::span<const int> shape_kind{};      ///< (ns) FCLIB_SPHERE, ...
  std::span<const double> shape_size{};   ///< (ns x 3)
  std::span<const double> shape_place{};  ///< (ns x 3) or none
  std::span<const double> shape_turn{};   ///< (ns x 4) or none
  std::span<const int> shape_mesh{};      ///< (ns) or none
  // of the meshes
  std::span<const int> mesh_first{};       ///< ((nm + 1) x 2) or none
  std::span<const double> vertex{};        ///< (x 3)
  std::span<const int> face{};             ///< (x 4)
  std::span<const double> displacement{};  ///< (x 3) or none
  std::span<const double> period{};        ///< (2) or none
  bool planar = false;
  std::string unit{};       ///< of lengths, empty for m
  std::string mass_unit{};  ///< of masses, empty for kg
  // of each rigid body
  std::span<const double> mass{};     ///< (nb) or none; 0 if it is fixed
  std::span<const double> inertia{};  ///< (nb x 3) or none: principal moments about its centre
  std::span<const double> center{};   ///< (nb x 3) or none: centre of mass in its frame
  std::span<const double> axes{};     ///< (nb x 4) or none: turn of its principal axes in its frame
  // of the step
  std::span<const double> velocity{};  ///< (n) or none: generalised, at its start
  std::span<const double>
      impulse{};  ///< (n) or none: of all known forces, f = M velocity + impulse
};

namespace detail {

/// What call(view) returns of the struct that the library takes.
template <class Call>
auto with_view(const Geometry& geometry, const Call& call) {
  const std::size_t nc = geometry.body.size() / 2;
  const std::size_t nb = geometry.moves.size();
  const std::size_t ns = geometry.shape_kind.size();
  const auto array = [](const char* name, const auto& values, std::size_t expected) {
    if (!values.empty()) require_size(name, values.size(), expected);
    return values.empty() ? nullptr : values.data();
  };
  std::vector<const char*> names;
  for (const std::string& name : geometry.name) names.push_back(detail::text("a name", name));
  fclib_geometry c{};
  c.size = sizeof c;
  c.nc = detail::count(nc);
  c.body = array("body", geometry.body, 2 * nc);
  c.shape = array("shape", geometry.shape, 2 * nc);
  c.feature = array("feature", geometry.feature, nc);
  c.point = array("point", geometry.point, 3 * nc);
  c.normal = array("normal", geometry.normal, 3 * nc);
  c.tangent = array("tangent", geometry.tangent, 3 * nc);
  c.gap = array("gap", geometry.gap, nc);
  c.nb = detail::count(nb);
  c.name = array("name", names, nb);
  c.moves = array("moves", geometry.moves, nb);
  c.place = array("place", geometry.place, 3 * nb);
  c.turn = array("turn", geometry.turn, 4 * nb);
  c.ns = detail::count(ns);
  c.shape_body = array("shape_body", geometry.shape_body, ns);
  c.shape_kind = array("shape_kind", geometry.shape_kind, ns);
  c.shape_size = array("shape_size", geometry.shape_size, 3 * ns);
  c.shape_place = array("shape_place", geometry.shape_place, 3 * ns);
  c.shape_turn = array("shape_turn", geometry.shape_turn, 4 * ns);
  c.shape_mesh = array("shape_mesh", geometry.shape_mesh, ns);
  if (const std::size_t size = geometry.mesh_first.size(); size > 0) {
    if (size % 2 != 0) throw Error("mesh_first has an odd number of entries");
    c.nm = detail::count(size / 2 - 1);
    c.mesh_first = geometry.mesh_first.data();
    const auto last = [&](std::size_t k) {
      return static_cast<std::size_t>(std::max(geometry.mesh_first[size - k], 0));
    };
    c.vertex = array("vertex", geometry.vertex, 3 * last(2));
    c.face = array("face", geometry.face, 4 * last(1));
    c.displacement = array("displacement", geometry.displacement, 3 * last(2));
  }
  c.period = array("period", geometry.period, 2);
  c.planar = geometry.planar ? 1 : 0;
  c.unit = geometry.unit.empty() ? nullptr : detail::text("unit", geometry.unit);
  c.mass_unit =
      geometry.mass_unit.empty() ? nullptr : detail::text("mass_unit", geometry.mass_unit);
  c.mass = array("mass", geometry.mass, nb);
  c.inertia = array("inertia", geometry.inertia, 3 * nb);
  c.center = array("center", geometry.center, 3 * nb);
  c.axes = array("axes", geometry.axes, 4 * nb);
  const std::size_t n = std::max(geometry.velocity.size(), geometry.impulse.size());
  c.n = detail::count(n);
  c.velocity = array("velocity", geometry.velocity, n);
  c.impulse = array("impulse", geometry.impulse, n);
  return call(c);
}

}  // namespace detail

/// Adds a geometry to a file that has a problem with the same number of contacts.
inline void write_geometry(const std::string& path, const Geometry& geometry) {
  detail::with_view(geometry, [&](const fclib_geometry& view) {
    return checked(fclib_write_geometry(&view, detail::text("a path", path)));
  });
}

// ---- many problems in one file

/// Whether a sequence replaces a file that is there, or goes on with it.
enum class Start { create, go_on };

/// Writes a sequence: the problems of a simulation, step by step, in one file. fclib.h says when a
/// step is confirmed. Step 17 of "run.h5" is read as "run.h5#17".
class SequenceWriter {
 public:
  explicit SequenceWriter(const std::string& path, Start start = Start::create)
      : handle_(checked(start == Start::create
                            ? fclib_sequence_create(detail::text("a path", path), nullptr)
                            : fclib_sequence_continue(detail::text("a path", path)))) {}

  /// Begins a step of a world.
  template <Problem C>
  void add(const C& problem, int world = 0) {
    checked(Calls<C>::add(handle_.get(), &problem, world));
    sizes_ = sizes(problem);
  }

  // what else belongs to the step
  void add_solution(const Solution& solution) {
    detail::require_sizes(solution, sizes_);
    fclib_solution view = solution.view();
    checked(fclib_sequence_add_solution(handle_.get(), &view));
  }
  void add_guesses(std::span<const Solution> guesses) {
    std::vector<fclib_solution> views;
    for (const Solution& guess : guesses) {
      detail::require_sizes(guess, sizes_);
      views.push_back(guess.view());
    }
    checked(fclib_sequence_add_guesses(handle_.get(), detail::count(views.size()), views.data()));
  }
  void add_geometry(const Geometry& geometry) {
    detail::with_view(geometry, [&](const fclib_geometry& view) {
      return checked(fclib_sequence_add_geometry(handle_.get(), &view));
    });
  }

  /// Ends the step and confirms all.
  void flush() { checked(fclib_sequence_flush(handle_.get())); }
  /// The same, and the disk has it. Without this call the destructor does so, and reports no error.
  void close() { checked(fclib_sequence_close(handle_.release())); }

 private:
  struct Close {
    void operator()(fclib_sequence* sequence) const { fclib_sequence_close(sequence); }
  };
  std::unique_ptr<fclib_sequence, Close> handle_;
  Sizes sizes_;
};

/// How many confirmed steps a sequence has.
inline std::size_t sequence_size(const std::string& path) {
  const int size = fclib_sequence_size(detail::text("a path", path));
  if (size < 0) fail();
  return static_cast<std::size_t>(size);
}

// ---- solving

/// What a solver reports while it works.
struct Progress {
  int iteration = 0;
  double error = 0;        ///< the solver's own
  double time = 0;         ///< wall clock [s]
  std::string_view stage;  ///< the method at work, if the solver chains several
};

/// What a caller asks of a solver. The values here ask for the defaults.
struct Options {
  double tolerance = 0;                                 ///< on MERIT_2; 0 for 1e-8
  int max_iterations = 0;                               ///< 0 for the solver's own
  double time_limit = 0;                                ///< wall clock [s]; 0 for none
  std::span<const double> guess{};                      ///< reactions to start from (m), or none
  std::map<std::string, std::string> solver_options{};  ///< of this solver, by name
  std::function<bool(const Progress&)> progress{};      ///< false stops it: FCLIB_INTERRUPTED
};

/// How a solve ended, and the solution it left.
struct Result {
  fclib_status status = FCLIB_DIVERGED;
  int iterations = 0;
  double error = 0;              ///< MERIT_2 of the solution
  double cpu_s = 0;              ///< CPU time of the solver alone [s]
  double time = 0;               ///< wall clock of the solver alone [s]
  double certificate_bound = 0;  ///< if the status is FCLIB_INFEASIBLE
  Solution solution;
  std::vector<double> certificate_y, certificate_z;  ///< ... and its proof

  [[nodiscard]] bool converged() const { return status == FCLIB_CONVERGED; }
  [[nodiscard]] std::string_view status_name() const { return fclib_status_name(status); }
};

namespace detail {

struct DeleteHandle {
  void operator()(fclib_options* options) const { fclib_options_delete(options); }
  void operator()(fclib_report* report) const { fclib_report_delete(report); }
};
template <class Struct>
using Handle = std::unique_ptr<Struct, DeleteHandle>;

/// A caller's function, and the exception that it threw, which must not pass through C.
struct Watch {
  const std::function<bool(const Progress&)>& progress;
  std::exception_ptr thrown = nullptr;

  static int tell(int iteration, double error, double time, const char* stage, void* context) {
    auto& watch = *static_cast<Watch*>(context);
    try {
      return watch.progress({iteration, error, time, stage}) ? 0 : 1;
    } catch (...) {
      watch.thrown = std::current_exception();
      return 1;
    }
  }
};

inline std::vector<double> array(const fclib_report& report, const char* name) {
  int count = 0;
  const double* const first = checked(fclib_report_array(&report, name, &count));
  return {first, first + count};
}

}  // namespace detail

/// Solves a problem. Throws for data that makes no sense, for an unknown solver or option, and what
/// the progress function threw. If the solver ran, the status says how it ended.
template <Problem C>
Result solve(const C& problem, const std::string& solver = "auto", const Options& options = {}) {
  const detail::Handle<fclib_options> handle(checked(fclib_options_create()));
  fclib_options* const asked = handle.get();
  for (const auto& [name, value] : options.solver_options) {
    checked(fclib_options_set_text(asked, detail::text("the name of an option", name),
                                   detail::text("the value of an option", value)));
  }
  checked(fclib_options_set_text(asked, "solver", detail::text("the name of a solver", solver)));
  const auto set = [asked](const char* name, double value) {
    if (value != 0) checked(fclib_options_set_number(asked, name, value));
  };
  set("tolerance", options.tolerance);
  set("max_iterations", options.max_iterations);
  set("time_limit", options.time_limit);
  if (!options.guess.empty()) {
    checked(fclib_options_set_array(asked, "guess", options.guess.data(),
                                    detail::count(options.guess.size())));
  }
  detail::Watch watch{options.progress};
  if (options.progress) {
    checked(fclib_options_set_progress(asked, detail::Watch::tell, &watch));
  }
  const detail::Handle<fclib_report> report(Calls<C>::solve(&problem, asked));
  if (watch.thrown) std::rethrow_exception(watch.thrown);
  checked(report.get());

  const auto number = [&](const char* name) { return fclib_report_number(report.get(), name); };
  const auto array = [&](const char* name) { return detail::array(*report, name); };
  Result result;
  result.status = static_cast<fclib_status>(number("status"));
  result.iterations = static_cast<int>(number("iterations"));
  result.error = number("error");
  result.cpu_s = number("cpu_s");
  result.time = number("time");
  result.certificate_bound = number("certificate_bound");
  result.solution.v = array("v");
  result.solution.u = array("u");
  result.solution.r = array("r");
  result.solution.l = array("l");
  result.certificate_y = array("certificate_y");
  result.certificate_z = array("certificate_z");
  return result;
}

/// The names of all solvers.
inline std::vector<std::string_view> solvers() {
  std::vector<std::string_view> names;
  for (int k = 0; const char* name = fclib_solver_name(k); ++k) names.emplace_back(name);
  return names;
}

}  // namespace facade
}  // namespace fclib
