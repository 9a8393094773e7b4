#include <nanobind/eigen/dense.h>
#include <nanobind/stl/function.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <concepts>
#include <string>
#include <tuple>
#include <type_traits>

#include "arrays.hpp"
#include "chain/description.hpp"
#include "fields.hpp"
#include "fingerprints.hpp"
#include "module.hpp"
#include "solve/driver.hpp"
#include "stepping/rest.hpp"

namespace fclib::bindings {

using namespace nb::literals;

namespace {

/// The user's callback, which needs the GIL.
std::function<bool(const Progress&)> make_callback(const nb::object& callback) {
  if (callback.is_none()) return {};
  return [&callback](const Progress& progress) {
    const nb::gil_scoped_acquire gil;
    const nb::object answer =
        callback(progress.iteration, progress.error, progress.time, std::string(progress.stage));
    if (answer.is_none()) return true;
    const int truth = PyObject_IsTrue(answer.ptr());  // NumPy's too
    if (truth < 0) throw nb::python_error();
    return truth == 1;
  };
}

/// Another clock, for tests of code that reads the clock.
Clock make_clock(const nb::object& clock) {
  if (clock.is_none()) return {};
  return [&clock] {
    const nb::gil_scoped_acquire gil;
    return nb::cast<double>(clock());
  };
}

template <class P>
void bind_proof(nb::module_& m) {
  m.def(
      "prove_no_solution",
      [](const P& problem, const Vector& y) -> std::optional<std::tuple<Vector, Vector, double>> {
        if (y.size() != problem.size(Dim::nc)) {
          throw Error(ErrorKind::problem,
                      "has " + std::to_string(y.size()) +
                          " entries, expected nc = " + std::to_string(problem.size(Dim::nc)),
                      "y");
        }
        NoSolution found = prove_no_solution(problem, y);
        if (!found.proven()) return std::nullopt;
        return std::tuple(std::move(found.y), std::move(found.z), found.bound);
      },
      "problem"_a, "y"_a,
      "y, z and the bound of a proof near y (nc) that the problem has no solution (see\n"
      "Result.certificate), or None.");
}

/// The result of visit(problem) for a problem of any formulation. It is one function for all of
/// them: with overloads, most of which do not fit, a call takes longer.
template <class Visitor>
nb::object visit_problem(nb::handle object, const Visitor& visit) {
  nb::object result;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if (!result.is_valid() && nb::isinstance<P>(object)) {
      result = nb::cast(visit(*nb::inst_ptr<P>(object)));
    }
  });
  if (!result.is_valid()) throw nb::next_overload();  // nanobind lists what fits
  return result;
}

void bind_solve(nb::module_& m) {
  m.def(
      "solve",
      [](const nb::object& problem, const Solver& solver, double tolerance,
         std::int64_t max_iterations, double time_limit, const nb::dict& options,
         const nb::object& guess, const nb::object& callback, bool history, bool natural,
         const nb::object& clock, std::optional<double> still) {
        Settings settings{.tolerance = tolerance,
                          .merit = natural ? MeritKind::natural : MeritKind::both,
                          .max_iterations = max_iterations,
                          .time_limit = time_limit,
                          .callback = make_callback(callback),
                          .poll = poll_signals,
                          .clock = make_clock(clock),
                          .history = history};
        OptionValues values;
        if (options.size() > 0) values = nb::cast<OptionValues>(options);
        const Solution start = guess.is_none() ? Solution{} : solution_from(guess, "guess");
        return visit_problem(problem, [&]<class P>(const P& given) {
          Preference prefer;
          if constexpr (std::derived_from<P, GlobalProblem>) {
            if (still) {
              prefer = [&](const Solution& found) {
                return stepping::nearest_at_rest(given, found, start.r, *still);
              };
            }
          }
          if (!guess.is_none()) {  // to the driver no entries are no guess
            detail::require_size(static_cast<Index>(start.r.size()), given.size(Dim::m), Dim::m,
                                 "guess r", "entries");
          }
          const Unlocked unlocked;
          return solve(given, solver, settings, values, start, prefer);
        });
      },
      "problem"_a, "solver"_a, "tolerance"_a, "max_iterations"_a, "time_limit"_a, "options"_a,
      "guess"_a.none(), "callback"_a.none(), "history"_a, "natural"_a,
      "clock"_a.none() = nb::none(), "still"_a.none() = nb::none(),
      nb::sig(("def solve(problem: " + problem_union() +
               ", solver: SolverInfo, tolerance: float, max_iterations: int, time_limit: float, "
               "options: collections.abc.Mapping[str, bool | int | float | str], "
               "guess: object | None, callback: object | None, history: bool, natural: bool, "
               "clock: object | None = None, still: float | None = None) -> Result")
                  .c_str()),
      "With `still`, a relative velocity: if the solution of a global problem took iterations and\n"
      "its bodies are slower, it is solved again from the reactions at rest nearest to the guess.");
}

nb::object history_of(const Result& result) {
  if (!result.history) return nb::none();
  nb::list points;
  std::size_t longest = 1;
  for (const HistoryPoint& point : *result.history) {
    points.append(nb::make_tuple(point.iteration, point.error, point.time, point.stage));
    longest = std::max(longest, point.stage.size());
  }
  nb::list type;
  type.append(nb::make_tuple("iteration", "i8"));
  type.append(nb::make_tuple("error", "f8"));
  type.append(nb::make_tuple("time", "f8"));
  type.append(nb::make_tuple("stage", "U" + std::to_string(longest)));
  return nb::module_::import_("numpy").attr("array")(points, "dtype"_a = type);
}

/// For a class that users never construct: pickling, and copies with it. `get` gives the values and
/// `set` takes them.
template <class Class, class Get, class Set>
void def_state(nb::class_<Class>& cls, Get get, Set set) {
  cls.def("__getstate__", get, nb::sig("def __getstate__(self) -> dict[str, object]"));
  cls.def(
      "__setstate__",
      [set](Class& self, const nb::dict& values) {
        new (&self) Class();
        set(self, values);
      },
      nb::sig("def __setstate__(self, values: dict[str, object], /) -> None"));
}

template <class Member>
void take(Member& member, const nb::dict& values, const char* name) {
  member = nb::cast<Member>(values[name]);
}

/// Visits (name, member) of all parts of an option.
template <class OptionOrConst, class Visitor>
  requires std::same_as<std::remove_const_t<OptionOrConst>, OptionInfo>
void for_each_part(OptionOrConst& option, const Visitor& visit) {
  visit("name", option.name);
  visit("type", option.type);
  visit("default", option.default_value);
  visit("unit", option.unit);
  visit("doc", option.doc);
  visit("choices", option.choices);
  visit("lowest", option.lowest);
  visit("highest", option.highest);
}

/// Visits (name, member) of all parts of a stage.
template <class StageOrConst, class Visitor>
  requires std::same_as<std::remove_const_t<StageOrConst>, Stage>
void for_each_part(StageOrConst& stage, const Visitor& visit) {
  visit("name", stage.kind.name);
  visit("families", stage.kind.families);
  visit("calls", stage.calls);
  visit("solved", stage.solved);
  visit("iterations", stage.iterations);
  visit("factorisations", stage.factorisations);
  visit("cpu_s", stage.cpu_s);
  visit("time", stage.time);
}

template <class Class>
  requires requires(Class& one) { for_each_part(one, [](const char*, auto&) {}); }
nb::dict state_of(const Class& one) {
  nb::dict values;
  for_each_part(one, [&](const char* name, const auto& member) { values[name] = member; });
  return values;
}

template <class Class>
  requires requires(Class& one) { for_each_part(one, [](const char*, auto&) {}); }
void set_state(Class& one, const nb::dict& values) {
  for_each_part(one, [&](const char* name, auto& member) { take(member, values, name); });
}

bool same(const Stage& a, const Stage& b) {
  return std::tie(a.kind.name, a.kind.families, a.calls, a.solved, a.iterations,
                  a.factorisations) ==
         std::tie(b.kind.name, b.kind.families, b.calls, b.solved, b.iterations, b.factorisations);
}

using Point = std::tuple<std::int64_t, double, double, std::string>;

nb::dict state_of(const Result& result) {
  nb::dict values;
  values["solution"] = result.solution;
  values["status"] = static_cast<int>(result.status);
  values["iterations"] = result.iterations;
  values["error"] = result.error;
  values["cpu_s"] = result.cpu_s;
  values["time"] = result.time;
  values["setup_s"] = result.setup_s;
  values["solver"] = result.solver;
  values["message"] = result.message;
  const NoSolution& proof = result.certificate;
  values["certificate"] = std::tuple(proof.y, proof.z, proof.gain, proof.distance, proof.bound);
  values["stages"] = result.stages;
  std::optional<std::vector<Point>> history;
  if (result.history) {
    history.emplace();
    for (const HistoryPoint& point : *result.history) {
      history->emplace_back(point.iteration, point.error, point.time, point.stage);
    }
  }
  values["history"] = history;
  return values;
}

void set_state(Result& result, const nb::dict& values) {
  take(result.solution, values, "solution");
  int status = 0;
  take(status, values, "status");
  if (status < 0 || status > static_cast<int>(Status::infeasible)) {
    throw nb::value_error("a result of this status is not of this version");
  }
  result.status = static_cast<Status>(status);
  take(result.iterations, values, "iterations");
  take(result.error, values, "error");
  take(result.cpu_s, values, "cpu_s");
  take(result.time, values, "time");
  take(result.setup_s, values, "setup_s");
  take(result.solver, values, "solver");
  take(result.message, values, "message");
  std::tuple<Vector, Vector, double, double, double> proof;
  take(proof, values, "certificate");
  auto& [y, z, gain, distance, bound] = proof;
  result.certificate = {y, z, gain, distance, bound};
  take(result.stages, values, "stages");
  std::optional<std::vector<Point>> history;
  take(history, values, "history");
  if (!history) return;
  result.history.emplace();
  for (const auto& [iteration, error, time, stage] : *history) {
    result.history->push_back({iteration, error, time, stage});
  }
}

/// Whether two results agree. Times are not compared: they differ from run to run.
bool same(const Result& a, const Result& b) {
  const auto same_point = [](const HistoryPoint& one, const HistoryPoint& other) {
    return std::tie(one.iteration, one.error, one.stage) ==
           std::tie(other.iteration, other.error, other.stage);
  };
  if (a.history.has_value() != b.history.has_value()) return false;
  return std::tie(a.status, a.iterations, a.error, a.solver, a.certificate.bound) ==
             std::tie(b.status, b.iterations, b.error, b.solver, b.certificate.bound) &&
         equal(a.solution, b.solution) && equal(a.certificate.y, b.certificate.y) &&
         equal(a.certificate.z, b.certificate.z) &&
         std::ranges::equal(a.stages, b.stages,
                            [](const Stage& x, const Stage& y) { return same(x, y); }) &&
         (!a.history || std::ranges::equal(*a.history, *b.history, same_point));
}

/// Equality by `same`, and a hash of the name, which identifies it.
template <class Class, class Same, class Name>
void def_same(nb::class_<Class>& cls, Same same, Name name) {
  cls.def(
      "__eq__",
      [same](const Class& self, nb::handle other) {
        return nb::isinstance<Class>(other) && same(self, nb::cast<const Class&>(other));
      },
      nb::arg("other").none(), nb::sig("def __eq__(self, other: object, /) -> bool"));
  cls.def("__hash__", [name](const Class& self) {
    return static_cast<Py_ssize_t>(std::hash<std::string>{}(name(self)));
  });
}

}  // namespace

Solution solution_from(nb::handle object, const char* what) {
  if (nb::isinstance<Solution>(object)) return nb::cast<const Solution&>(object);
  if (nb::isinstance<Result>(object)) return nb::cast<const Result&>(object).solution;
  Solution solution;
  solution.r = vector_from(object, what);
  return solution;
}

void bind_solvers(nb::module_& m) {
  nb::class_<OptionInfo> option(m, "OptionInfo", "An option of a solver.");
  option
      .def(
          "__init__",
          [](OptionInfo* self, const std::string& name, const std::string& type,
             const OptionValue& default_value, const std::string& unit, const std::string& doc,
             const std::vector<std::string>& choices, double lowest, double highest) {
            new (self) OptionInfo{name, type, default_value, unit, doc, choices, lowest, highest};
          },
          nb::kw_only(), "name"_a, "type"_a, "default"_a, "unit"_a, "doc"_a, "choices"_a,
          "lowest"_a, "highest"_a)
      .def_ro("name", &OptionInfo::name)
      .def_ro("type", &OptionInfo::type, "bool, int, float, choice or text")
      .def_ro("default", &OptionInfo::default_value)
      .def_ro("unit", &OptionInfo::unit)
      .def_ro("doc", &OptionInfo::doc)
      .def_ro("choices", &OptionInfo::choices, "the values of a choice")
      .def_ro("lowest", &OptionInfo::lowest)
      .def_ro("highest", &OptionInfo::highest);
  def_state(
      option, [](const OptionInfo& self) { return state_of(self); },
      [](OptionInfo& self, const nb::dict& values) { set_state(self, values); });
  def_same(
      option,
      [](const OptionInfo& a, const OptionInfo& b) {
        return nb::cast<bool>(nb::object(state_of(a)).equal(state_of(b)));
      },
      [](const OptionInfo& self) { return self.name; });
  option.def("__repr__", [](const OptionInfo& self) {
    const nb::object value = nb::cast(self.default_value);
    return "<OptionInfo " + self.name + ": " + self.type + " = " +
           nb::cast<std::string>(nb::repr(value)) + ">";
  });
  nb::class_<Solver>(m, "SolverInfo", "A solver of the registry.")
      .def_ro("name", &Solver::name)
      .def_ro("family", &Solver::family)
      .def_ro("title", &Solver::title)
      .def_ro("citation", &Solver::citation)
      .def_ro("origin", &Solver::origin, "the package that it comes from")
      .def_ro("dimensions", &Solver::dimensions, "the spacedims it takes")
      .def_ro("rolling_dimensions", &Solver::rolling_dimensions,
              "the spacedims of rolling problems")
      .def_ro("spin_dimensions", &Solver::spin_dimensions, "the spacedims of problems with spin")
      .def_ro("options", &Solver::options)
      .def_ro("max_iterations", &Solver::max_iterations, "the limit if the caller sets none")
      .def(
          "check_options",
          [](const Solver& s, const OptionValues& options) { s.check_options(options); },
          "options"_a,
          "Raises OptionError at the first option that is unknown or has a wrong value.")
      // by its name: a solver is code
      .def(
          "__reduce__",
          [](const Solver& s) {
            return nb::make_tuple(nb::module_::import_("fclib._registry").attr("find_solver"),
                                  nb::make_tuple(s.name));
          },
          nb::sig("def __reduce__(self) -> tuple[object, ...]"))
      .def("__repr__",
           [](const Solver& s) { return "<SolverInfo " + s.name + ": " + s.title + ">"; });
  m.def(
      "solvers",
      [] {
        nb::list result;
        for (const Solver* solver : solvers())
          result.append(nb::cast(solver, nb::rv_policy::reference));
        return result;
      },
      nb::sig("def solvers() -> list[SolverInfo]"), "The solvers of the core, by name.");
  m.def(
      "fingerprints", &fingerprints,
      "What tells two builds of a solver of the core apart: a digest of its sources, by its name.");
  m.def(
      "find_solver", [](const std::string& name) { return &find_solver(name); }, "name"_a,
      nb::rv_policy::reference,
      "The solver of this name in the core. Raises OptionError if there is none.");
  nb::class_<chain::MethodInfo>(m, "ChainMethod", "A method that a stage of a chain may name.")
      .def_ro("name", &chain::MethodInfo::name)
      .def_ro("doc", &chain::MethodInfo::doc)
      .def_ro("rules", &chain::MethodInfo::rules, "the keys that its stages take")
      .def("__repr__", [](const chain::MethodInfo& self) {
        return "<ChainMethod " + self.name + ": " + self.doc + ">";
      });
  m.def("chain_methods", &chain::describe_methods,
        "The words of the option chain of ``auto``: first, without a name, the keys that any stage "
        "may have, then each method with its rules.");
  bind_python_solvers(m);

  nb::class_<Stage> stage(m, "Stage", "A part of a solve, by a method of its own.");
  def_state(
      stage, [](const Stage& self) { return state_of(self); },
      [](Stage& self, const nb::dict& values) { set_state(self, values); });
  def_same(
      stage, [](const Stage& a, const Stage& b) { return same(a, b); },
      [](const Stage& self) { return self.kind.name; });
  stage.def_prop_ro("name", [](const Stage& s) { return s.kind.name; })
      .def_prop_ro(
          "families", [](const Stage& s) { return s.kind.families; },
          "of solvers whose methods it uses, separated by ', '")
      .def_ro("calls", &Stage::calls, "how often it was entered: once for each island in need")
      .def_ro("solved", &Stage::solved, "of these, how many it brought to the tolerance")
      .def_ro("iterations", &Stage::iterations)
      .def_ro("factorisations", &Stage::factorisations)
      .def_ro("cpu_s", &Stage::cpu_s, "[s] CPU time of all threads")
      .def_ro("time", &Stage::time, "[s] wall clock")
      .def("__repr__", [](const Stage& s) {
        const std::string count = s.iterations == 1 ? " iteration>" : " iterations>";
        return "<Stage " + s.kind.name + ": solved " + std::to_string(s.solved) + " of " +
               std::to_string(s.calls) + ", " + std::to_string(s.iterations) + count;
      });
  nb::class_<Result> result(m, "Result",
                            "What fclib.solve returns. Results are equal if everything but their "
                            "times is.");
  def_state(
      result, [](const Result& self) { return state_of(self); },
      [](Result& self, const nb::dict& values) { set_state(self, values); });
  def_same(
      result, [](const Result& a, const Result& b) { return same(a, b); },
      [](const Result& self) { return self.solver + std::to_string(self.iterations); });
  def_html(result);
  result.def(
      "plot",
      [](nb::handle self) { return nb::module_::import_("fclib.notebook").attr("plot")(self); },
      nb::sig("def plot(self) -> Any"),
      "How the error fell, for a notebook, if fclib.solve was asked for the history. See\n"
      "fclib.notebook.plot.");
  result.def_ro("solution", &Result::solution)
      .def_prop_ro(
          "status", [](const Result& r) { return std::string(name_of(r.status)); },
          "converged, iteration_limit, time_limit, diverged, inaccurate, stalled, interrupted or\n"
          "infeasible")
      .def_prop_ro("converged", &Result::converged, "whether the error is at most the tolerance")
      .def_ro("iterations", &Result::iterations)
      .def_ro("error", &Result::error,
              "Merit.error of the solution on the problem as given (Merit.error_by if `solve` was "
              "asked for a merit)")
      .def_ro("cpu_s", &Result::cpu_s, "[s] CPU time of the solver alone")
      .def_ro("time", &Result::time, "[s] wall clock of the solver alone")
      .def_ro("setup_s", &Result::setup_s, "[s] CPU time of conversions, validation and merit")
      .def_ro("solver", &Result::solver)
      .def_ro("message", &Result::message, "what a user should know, in words; mostly empty")
      .def_prop_ro(
          "certificate",
          [](nb::handle self) -> nb::object {
            const auto& r = nb::cast<const Result&>(self);
            return r.certificate.proven() ? to_python(r.certificate.y, self) : nb::none();
          },
          nb::for_getter(
              nb::sig("def certificate(self, /) -> numpy.typing.NDArray[numpy.float64] | None")),
          "If the status is infeasible: y >= 0 (nc,), which proves that the problem as it was "
          "given\n"
          "has no solution. Else None. E y is the vector whose normal parts are y. Then, for a "
          "local\n"
          "problem, -(W^T E y + V z) is in K*, V^T E y + R^T z = 0 and y . q_N + z . s < 0. For a\n"
          "global problem, H E y + G z = 0 and y . w_N + z . b < 0. The sums of a global problem "
          "may\n"
          "vanish for real numbers close to y and z instead. fclib.analysis.check_arrays gives "
          "them.")
      .def_prop_ro(
          "certificate_z",
          [](nb::handle self) -> nb::object {
            const auto& r = nb::cast<const Result&>(self);
            return r.certificate.z.size() > 0 ? to_python(r.certificate.z, self) : nb::none();
          },
          nb::for_getter(
              nb::sig("def certificate_z(self, /) -> numpy.typing.NDArray[numpy.float64] | None")),
          "z (p) of the certificate, if the problem has bilateral constraints")
      .def_prop_ro(
          "certificate_bound",
          [](const Result& r) -> std::optional<double> {
            if (!r.certificate.proven()) return std::nullopt;
            return r.certificate.bound;
          },
          "If the status is infeasible: no reactions of a norm below this are a solution. It is "
          "inf\n"
          "if the proof is exact. It is finite if only the last digits of W are left of W^T E y.\n"
          "Else None.")
      .def_ro("stages", &Result::stages, "of a solver that chains others, in their order")
      .def_prop_ro(
          "history", history_of,
          nb::sig("def history(self) -> numpy.typing.NDArray[numpy.void] | None"),
          "The reports of the solver, if fclib.solve was asked for them: a structured array "
          "with iteration, error, time [s] and stage.")
      .def("__repr__", [](const Result& r) {
        char text[160];
        std::snprintf(text, sizeof text, "<Result %s: %s, %lld iteration%s, error %.1e, %.2e s>",
                      r.solver.c_str(), std::string(name_of(r.status)).c_str(),
                      static_cast<long long>(r.iterations), r.iterations == 1 ? "" : "s", r.error,
                      r.cpu_s);
        return std::string(text);
      });
  m.def(
      "solution_from",
      [](const nb::object& given, const std::string& what) {
        return solution_from(given, what.c_str());
      },
      "given"_a, "what"_a = "solution",
      nb::sig(
          ("def solution_from(given: " + solution_type + ", what: str = 'solution') -> Solution")
              .c_str()),
      "What a solution or a guess may be given as: a Solution, that of a Result, or "
      "reactions.\n\n"
      "Raises ProblemError, by the name of what it is, for anything else.");
  for_each_formulation([&]<class P>(std::type_identity<P>) { bind_proof<P>(m); });
  bind_solve(m);
}

}  // namespace fclib::bindings
