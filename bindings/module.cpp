// The Python module fclib._core: problems, files, solvers and merits.
//
// Loops over the formulations, their fields and the solvers' registry; names none of them.

#include <nanobind/nanobind.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/function.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <filesystem>
#include <initializer_list>

#include "arrangements.hpp"
#include "conversions.hpp"
#include "convert/complete.hpp"
#include "convert/condense.hpp"
#include "convert/eliminate.hpp"
#include "fields.hpp"
#include "io/hdf5/hdf5.hpp"
#include "merit/merit.hpp"
#include "merit/merit_1.hpp"
#include "python_solver.hpp"
#include "solve/driver.hpp"
#include "version.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace fclib::bindings {

namespace {

namespace fs = std::filesystem;
using Unlocked = nb::gil_scoped_release;

// ---- errors

PyObject* exception_of[4];

void translate(const std::exception_ptr& pointer, void*) {
  try {
    std::rethrow_exception(pointer);
  } catch (const Error& error) {
    // a path need not be valid UTF-8
    const std::string text = error.what();
    const nb::object message = nb::steal(
        PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()), "replace"));
    PyErr_SetObject(exception_of[static_cast<int>(error.kind)], message.ptr());
  }
}

void bind_errors(nb::module_& m) {
  const auto define = [&](const char* name, nb::handle bases, const char* doc) {
    const std::string full = nb::cast<std::string>(m.attr("__name__")) + "." + name;
    const nb::object type =
        nb::steal(PyErr_NewExceptionWithDoc(full.c_str(), doc, bases.ptr(), nullptr));
    m.attr(name) = type;
    return type;
  };
  const nb::object base = define("Error", PyExc_Exception, "Base of all errors of fclib.");
  const auto derived = [&](ErrorKind kind, const char* name, PyObject* standard, const char* doc) {
    const nb::tuple bases = nb::make_tuple(base, nb::borrow(standard));
    exception_of[static_cast<int>(kind)] = define(name, bases, doc).release().ptr();
  };
  derived(ErrorKind::file, "FileError", PyExc_OSError,
          "A file cannot be read or written, or is not in the FCLIB layout.");
  derived(ErrorKind::problem, "ProblemError", PyExc_ValueError,
          "The data of a problem or of a solution is not valid.");
  derived(ErrorKind::option, "OptionError", PyExc_ValueError,
          "An unknown solver or option, or a value out of its range.");
  derived(ErrorKind::unsuitable, "UnsuitableError", PyExc_ValueError,
          "What is asked cannot be done for this problem.");
  nb::register_exception_translator(translate);
}

// ---- problems

/// "LocalProblem" for the kind "local".
std::string class_name(std::string_view kind) {
  std::string name;
  bool initial = true;
  for (const char c : kind) {
    if (c == '_') {
      initial = true;
      continue;
    }
    name += initial ? static_cast<char>(std::toupper(c)) : c;
    initial = false;
  }
  return name + "Problem";
}

template <class P>
void bind_problem(nb::module_& m) {
  const std::string name = class_name(P::kind);
  nb::class_<P> cls(m, name.c_str(), P::doc);
  def_construction(cls);
  def_fields(cls);
  cls.def_prop_ro("info", [](const P& p) { return p.info; }, "title, description, math_info");
  cls.def_prop_ro(
      "matrix_info",
      [](const P& p) {
        return nb::module_::import_("types").attr("MappingProxyType")(matrix_info_of(p));
      },
      nb::sig("def matrix_info(self, /) -> collections.abc.Mapping[str, MatrixInfo]"),
      "What is known of a matrix and cannot be read off its entries, by its name: "
      "matrix_info[\"W\"].rank. Matrices of which nothing is known are left out.");
  const auto def_size = [&](const char* dim_name, Dim dim, const char* doc) {
    cls.def_prop_ro(dim_name, [dim](const P& p) { return p.size(dim); }, doc);
  };
  def_size("n", Dim::n, "degrees of freedom (0 for a local problem)");
  def_size("m", Dim::m, "local unknowns, spacedim * nc");
  def_size("p", Dim::p, "bilateral constraints");
  def_size("nc", Dim::nc, "contacts");
  cls.def_prop_ro(
      "formulation", [](const P& p) { return formulation(p); },
      "the name of the formulation in RT-0444: 3DFC, GM3DFC, ...");
  cls.def_prop_ro(
      "kind", [](const P&) { return std::string(P::kind); },
      "the kind of the problem, which names its class and its group in a file");
  cls.def(
      "validate", [](const P& p) { validate(p); }, nb::call_guard<Unlocked>(),
      "Raises ProblemError at the first thing wrong with the data.");
  cls.def("__repr__", [name](const P& p) {
    std::string text =
        "<" + name + " " + formulation(p) + ": nc = " + std::to_string(p.size(Dim::nc));
    if (p.size(Dim::n) > 0) text += ", n = " + std::to_string(p.size(Dim::n));
    if (p.size(Dim::p) > 0) text += ", p = " + std::to_string(p.size(Dim::p));
    return text + ">";
  });
}

void bind_conversions(nb::module_& m) {
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    const nb::handle cls = m.attr(class_name(P::kind).c_str());
    const auto method = [&](const char* name, auto function, const char* doc) {
      nb::cpp_function_def(
          [function](const P& p) {
            validate(p);
            return function(p);
          },
          nb::scope(cls), nb::name(name), nb::is_method(), nb::call_guard<Unlocked>(), doc);
    };
    if constexpr (requires(const P& p) { condense(p); }) {
      method(
          "condense", [](const P& p) { return condense(p); },
          "The local problem: W = H^T M^-1 H, q = H^T M^-1 f + w (and V, R, s from G, b).\n\n"
          "Raises UnsuitableError where M is singular or not positive definite.");
    } else {
      method(
          "eliminate", [](const P& p) { return eliminate(p); },
          "The problem without bilateral constraints: W - V R^-1 V^T, q - V R^-1 s.\n\n"
          "Raises UnsuitableError where R is singular.");
    }
  });
}

// ---- solving

/// The user's callback, which needs the GIL.
std::function<bool(const Progress&)> make_callback(const nb::object& callback) {
  if (callback.is_none()) return {};
  return [&callback](const Progress& progress) {
    const nb::gil_scoped_acquire gil;
    const nb::object answer =
        callback(progress.iteration, progress.error, progress.time, std::string(progress.stage));
    return answer.is_none() || nb::cast<bool>(answer);
  };
}

/// Lets Ctrl-C through.
bool poll_signals() {
  const nb::gil_scoped_acquire gil;
  if (PyErr_CheckSignals() != 0) throw nb::python_error();
  return true;
}

template <class P>
void bind_solve(nb::module_& m) {
  m.def(
      "solve",
      [](const P& problem, const Solver& solver, double tolerance, std::int64_t max_iterations,
         double time_limit, const OptionValues& options, const Solution* guess,
         const nb::object& callback, bool history) {
        Settings settings{.tolerance = tolerance,
                          .max_iterations = max_iterations,
                          .time_limit = time_limit,
                          .callback = make_callback(callback),
                          .poll = poll_signals,
                          .history = history};
        const Unlocked unlocked;
        return solve(problem, solver, settings, options, guess != nullptr ? *guess : Solution{});
      },
      "problem"_a, "solver"_a, "tolerance"_a, "max_iterations"_a, "time_limit"_a, "options"_a,
      "guess"_a.none(), "callback"_a.none(), "history"_a);
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

void bind_solvers(nb::module_& m) {
  nb::class_<OptionInfo>(m, "OptionInfo", "An option of a solver.")
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
      .def_ro("type", &OptionInfo::type, "bool, int, float or choice")
      .def_ro("default", &OptionInfo::default_value)
      .def_ro("unit", &OptionInfo::unit)
      .def_ro("doc", &OptionInfo::doc)
      .def_ro("choices", &OptionInfo::choices, "the values of a choice")
      .def_ro("lowest", &OptionInfo::lowest)
      .def_ro("highest", &OptionInfo::highest);
  nb::class_<Solver>(m, "SolverInfo", "A solver of the registry.")
      .def_ro("name", &Solver::name)
      .def_ro("family", &Solver::family)
      .def_ro("title", &Solver::title)
      .def_ro("citation", &Solver::citation)
      .def_ro("origin", &Solver::origin, "the package that it comes from")
      .def_ro("dimensions", &Solver::dimensions, "the spacedims it takes")
      .def_ro("rolling_dimensions", &Solver::rolling_dimensions,
              "the spacedims of rolling problems")
      .def_ro("options", &Solver::options)
      .def_ro("max_iterations", &Solver::max_iterations, "where the caller sets none")
      .def(
          "check_options",
          [](const Solver& s, const OptionValues& options) { s.check_options(options); },
          "options"_a,
          "Raises OptionError at the first option that is unknown or has a wrong value.");
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
      "find_solver", [](const std::string& name) { return &find_solver(name); }, "name"_a,
      nb::rv_policy::reference,
      "The solver of this name in the core. Raises OptionError where there is none.");
  bind_python_solvers(m);

  nb::class_<Stage>(m, "Stage", "A part of a solve, by a method of its own.")
      .def_prop_ro("name", [](const Stage& s) { return std::string(s.name); })
      .def_ro("calls", &Stage::calls, "how often it was entered: once for each island in need")
      .def_ro("solved", &Stage::solved, "of these, how many it brought to the tolerance")
      .def_ro("iterations", &Stage::iterations)
      .def_ro("factorisations", &Stage::factorisations)
      .def_ro("time", &Stage::time, "[s] wall clock")
      .def("__repr__", [](const Stage& s) {
        return "<Stage " + std::string(s.name) + ": solved " + std::to_string(s.solved) + " of " +
               std::to_string(s.calls) + ", " + std::to_string(s.iterations) + " iterations>";
      });
  nb::class_<Result>(m, "Result", "What fclib.solve returns.")
      .def_ro("solution", &Result::solution)
      .def_prop_ro(
          "status", [](const Result& r) { return std::string(name_of(r.status)); },
          "converged, iteration_limit, time_limit, diverged, inaccurate, stalled, interrupted or\n"
          "infeasible")
      .def_prop_ro("converged", &Result::converged, "whether the error is at most the tolerance")
      .def_ro("iterations", &Result::iterations)
      .def_ro("error", &Result::error, "Merit.error of the solution, on the problem as given")
      .def_ro("cpu_s", &Result::cpu_s, "[s] CPU time of the solver alone")
      .def_ro("setup_s", &Result::setup_s, "[s] CPU time of conversions, validation and merit")
      .def_ro("solver", &Result::solver)
      .def_prop_ro(
          "certificate",
          [](nb::handle self) -> nb::object {
            const auto& r = nb::cast<const Result&>(self);
            return r.certificate.size() > 0 ? to_python(r.certificate, self) : nb::none();
          },
          nb::for_getter(
              nb::sig("def certificate(self, /) -> numpy.typing.NDArray[numpy.float64] | None")),
          "y >= 0 (nc) which proves that there is no solution where the status is infeasible: of\n"
          "the local problem without bilateral constraints, -W^T E y is in K* and y . q_N < 0,\n"
          "with E y the vector whose normal parts are y. Else None.")
      .def_ro("stages", &Result::stages, "of a solver that chains others, in their order")
      .def_prop_ro("history", history_of,
                   nb::sig("def history(self) -> numpy.typing.NDArray[numpy.void] | None"),
                   "Where fclib.solve was asked for it: what the solver reported, a structured "
                   "array with iteration, error, time [s] and stage.")
      .def("__repr__", [](const Result& r) {
        char text[160];
        std::snprintf(text, sizeof text, "<Result %s: %s, %lld iterations, error %.1e, %.2e s>",
                      r.solver.c_str(), std::string(name_of(r.status)).c_str(),
                      static_cast<long long>(r.iterations), r.error, r.cpu_s);
        return std::string(text);
      });
}

// ---- files

constexpr const char* path_type = "path: str | os.PathLike[str]";

std::string signature(const std::string& name, const std::string& rest, const std::string& result) {
  return "def " + name + "(" + path_type + rest + ") -> " + result;
}

/// "GlobalProblem | LocalProblem"
std::string problem_union() {
  std::string names;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    names += (names.empty() ? "" : " | ") + class_name(P::kind);
  });
  return names;
}

const std::string guesses_type = "guesses: collections.abc.Sequence[Solution]";
const std::string compression_type =
    "compression: int = " + std::to_string(WriteOptions{}.compression);

/// The options of a mode's name.
WriteOptions options_of(const std::string& mode, std::initializer_list<std::string_view> modes,
                        int compression) {
  std::string known;
  for (const auto name : modes) known += (known.empty() ? "" : ", ") + std::string(name);
  if (std::find(modes.begin(), modes.end(), mode) == modes.end()) {
    throw Error(ErrorKind::option, "there is no mode '" + mode + "'; there are: " + known, "mode");
  }
  return {.append = mode != "overwrite", .replace = mode == "replace", .compression = compression};
}

/// The problem that the solution and the guesses of a file belong to.
Problem read_owner(const std::string& path) {
  const Problem outline = read_outline(path);
  return read_problem(path, std::visit([]<class P>(const P&) { return P::kind; }, outline));
}

/// Guesses with all that readers of libfclib 3.1 need.
template <class P>
std::vector<Solution> complete(const P& problem, const std::vector<Solution>& guesses) {
  std::vector<Solution> result;
  for (const auto& guess : guesses) {
    validate(guess, problem, guess_path(result.size() + 1));
    result.push_back(fclib::complete(problem, guess));
  }
  return result;
}

void bind_files(nb::module_& m) {
  m.def(
      "read",
      [](const fs::path& path, const std::optional<std::string>& kind) {
        Problem problem = [&] {
          const Unlocked unlocked;
          return read_problem(path.string(), kind.value_or(""));
        }();
        return std::visit([](auto& p) { return nb::cast(std::move(p)); }, problem);
      },
      "path"_a, "kind"_a = nb::none(),
      nb::sig(signature("read", ", kind: str | None = None", problem_union()).c_str()),
      "The problem in an FCLIB file, validated. `kind` (\"local\", \"global\") chooses where the "
      "file holds several.\n\nRaises FileError, or ProblemError, naming file and dataset.");
  m.def(
      "read_solution", [](const fs::path& path) { return read_solution(path.string()); }, "path"_a,
      nb::sig(signature("read_solution", "", "Solution | None").c_str()),
      nb::call_guard<Unlocked>(),
      "The stored solution of a file, or None. It is that of the global problem where the file "
      "holds several. Raises FileError.");
  m.def(
      "read_guesses", [](const fs::path& path) { return read_guesses(path.string()); }, "path"_a,
      nb::sig(signature("read_guesses", "", "list[Solution]").c_str()), nb::call_guard<Unlocked>(),
      "The stored guesses of a file, of the problem that a solution would belong to. Raises "
      "FileError.");
  m.def(
      "contents",
      [](const fs::path& path) {
        Contents contents = read_contents(path.string());
        if (contents.solution) contents.kinds.emplace_back("solution");
        if (contents.guesses > 0) contents.kinds.emplace_back("guesses");
        return contents.kinds;
      },
      "path"_a, nb::sig(signature("contents", "", "list[str]").c_str()), nb::call_guard<Unlocked>(),
      "What a file holds: the kinds of its problems, \"solution\" and \"guesses\". Raises "
      "FileError.");
  m.def(
      "write_solution",
      [](const fs::path& path, const Solution& solution, int compression) {
        const Problem problem = read_owner(path.string());
        const Solution whole =
            std::visit([&](const auto& p) { return fclib::complete(p, solution); }, problem);
        write_solution(path.string(), whole, {.replace = true, .compression = compression});
      },
      "path"_a, "solution"_a, nb::kw_only(), "compression"_a = WriteOptions{}.compression,
      nb::sig(signature("write_solution", ", solution: Solution, *, " + compression_type, "None")
                  .c_str()),
      nb::call_guard<Unlocked>(),
      "Puts a solution into a file that has its problem, in place of the one it had, atomically. "
      "It is that of the global problem where the file holds several.\n\n"
      "Raises FileError, ProblemError where the sizes disagree, or OptionError for a compression "
      "outside 0..9.");
  m.def(
      "read_attributes",
      [](const fs::path& path, const std::string& group) {
        return read_attributes(path.string(), group);
      },
      "path"_a, "group"_a,
      nb::sig(signature("read_attributes", ", group: typing.Literal['solution', 'info']",
                        "dict[str, float | str]")
                  .c_str()),
      nb::call_guard<Unlocked>(),
      "What a file says of its solution, or of its problem (\"info\"), beside the data: numbers "
      "and texts by their names. Raises FileError.");
  m.def(
      "write_attributes",
      [](const fs::path& path, const std::string& group, const Attributes& attributes) {
        write_attributes(path.string(), group, attributes);
      },
      "path"_a, "group"_a, "attributes"_a,
      nb::sig(signature("write_attributes",
                        ", group: typing.Literal['solution', 'info'], attributes: "
                        "collections.abc.Mapping[str, float | str]",
                        "None")
                  .c_str()),
      nb::call_guard<Unlocked>(),
      "Gives the solution of a file, or its problem (\"info\"), attributes, in place of those of "
      "the same names, atomically. They go where the solution, or the problem, is replaced.\n\n"
      "Raises FileError where there is no solution in the file.");
  m.def(
      "write_guesses",
      [](const fs::path& path, const std::vector<Solution>& guesses, const std::string& mode,
         int compression) {
        WriteOptions options = options_of(mode, {"replace", "add"}, compression);
        options.append = mode == "add";
        const Problem problem = read_owner(path.string());
        const std::vector<Solution> whole =
            std::visit([&](const auto& p) { return complete(p, guesses); }, problem);
        write_guesses(path.string(), whole, options);
      },
      "path"_a, "guesses"_a, nb::kw_only(), "mode"_a = "replace",
      "compression"_a = WriteOptions{}.compression,
      nb::sig(signature("write_guesses",
                        ", " + guesses_type +
                            ", *, mode: typing.Literal['replace', 'add'] = "
                            "'replace', " +
                            compression_type,
                        "None")
                  .c_str()),
      nb::call_guard<Unlocked>(),
      "Puts guesses into a file that has their problem, atomically: in place of those it had "
      "(\"replace\"), or after them (\"add\").\n\n"
      "Raises FileError, ProblemError where the sizes disagree, or OptionError for an unknown mode "
      "or a compression outside 0..9.");
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    m.def(
        "write",
        [](const fs::path& path, const P& problem, const Solution* solution,
           const std::vector<Solution>& guesses, const std::string& mode, int compression) {
          const WriteOptions options =
              options_of(mode, {"overwrite", "add", "replace"}, compression);
          if (solution == nullptr && guesses.empty()) {
            write_file(path.string(), &problem, nullptr, {}, options);
            return;
          }
          validate(problem);
          const bool solved = solution != nullptr;
          const Solution whole = solved ? fclib::complete(problem, *solution) : Solution{};
          write_file(path.string(), &problem, solved ? &whole : nullptr, complete(problem, guesses),
                     options);
        },
        "path"_a, "problem"_a, "solution"_a.none() = nb::none(),
        "guesses"_a = std::vector<Solution>{}, nb::kw_only(), "mode"_a = "overwrite",
        "compression"_a = WriteOptions{}.compression,
        nb::sig(signature("write",
                          ", problem: " + class_name(P::kind) +
                              ", solution: Solution | None = None, " + guesses_type +
                              " = (), *, mode: typing.Literal['overwrite', 'add', 'replace'] = "
                              "'overwrite', " +
                              compression_type,
                          "None")
                    .c_str()),
        nb::call_guard<Unlocked>(),
        "Writes an FCLIB file, atomically. What the solution and the guesses lack of v and u is "
        "completed: readers of libfclib 3.1 need it.\n\n"
        "A file that is there is replaced whole (\"overwrite\"); or it keeps what it holds, and "
        "must not have such a problem (\"add\"), or gives up the problem of this kind, with its "
        "solution and its guesses (\"replace\"). In a file of several problems solution and "
        "guesses are those of the global one. compression is the level of deflate, 0 (none) to "
        "9.\n\n"
        "Raises FileError, ProblemError where the data is not valid, or OptionError for an unknown "
        "mode or a compression outside 0..9.");
  });
}

}  // namespace

NB_MODULE(_core, m) {
  m.doc() = "The core of fclib, in C++.";
  nb::set_leak_warnings(
      false);  // module-level references at exit are the interpreter's own business
  m.attr("version") = version;
  m.def(
      "build_info",
      [] {
        const auto dotted = [](int major, int minor, int patch) {
          return std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(patch);
        };
        return std::map<std::string, std::string>{
            {"compiler", compiler},
            {"eigen", dotted(EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
            {"hdf5", hdf5_loaded_version()},
            {"hdf5_compiled", hdf5_compiled_version()},
            {"hdf5_bundled", hdf5_bundled ? "yes" : ""},
            {"nanobind", dotted(NB_VERSION_MAJOR, NB_VERSION_MINOR, NB_VERSION_PATCH)}};
      },
      "What the core was built with, by its name, and the version of HDF5 that is loaded.\n\n"
      "hdf5_bundled is empty where HDF5 is a library of the system.");
  bind_errors(m);

  nb::class_<ProblemInfo> info(m, "ProblemInfo", "What a file says about its problem in words.");
  def_construction(info);
  def_fields(info);
  def_value(info);
  nb::class_<MatrixInfo> matrix_info(
      m, "MatrixInfo", "What is known of a matrix and cannot be read off its entries.");
  def_construction(matrix_info);
  def_fields(matrix_info);
  def_value(matrix_info);
  nb::class_<Solution> solution(m, "Solution", "A solution, or a guess, of any formulation.");
  def_construction(solution);
  def_fields(solution);
  nb::class_<Merit> merit_class(m, "Merit", "How good a solution is, judged from the data alone.");
  def_fields(merit_class);

  for_each_formulation([&]<class P>(std::type_identity<P>) { bind_problem<P>(m); });
  bind_conversions(m);
  bind_arrangements(m);
  bind_solvers(m);
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    bind_solve<P>(m);
    m.def(
        "merit_1", [](const P& p, const Solution& s) { return merit_1(p, s); }, "problem"_a,
        "solution"_a, nb::call_guard<Unlocked>(),
        "What libfclib calls MERIT_1, for comparisons with it.\n\n"
        "Raises ProblemError where problem or solution are not valid.");
    m.def(
        "contact_merits",
        [](const P& p, const Solution& s) {
          const ContactMerits merits = [&] {
            const Unlocked unlocked;
            return contact_merits(p, s);
          }();
          nb::list status;
          for (const ContactStatus one : merits.status) {
            status.append(one == ContactStatus::open    ? "open"
                          : one == ContactStatus::stick ? "stick"
                                                        : "slide");
          }
          const auto array = [](const Vector& values) {
            return to_python(values, nb::handle()).attr("copy")();
          };
          nb::dict result;
          result["status"] = nb::module_::import_("numpy").attr("array")(status, "dtype"_a = "U5");
          result["u"] = array(merits.u);
          result["natural"] = array(merits.natural);
          result["cone"] = array(merits.cone);
          result["dual_cone"] = array(merits.dual_cone);
          return result;
        },
        "problem"_a, "solution"_a,
        nb::sig(("def contact_merits(problem: " + class_name(P::kind) +
                 ", solution: Solution) -> dict[str, numpy.typing.NDArray[typing.Any]]")
                    .c_str()),
        "The merit contact by contact: status (open, stick, slide), u (m,) recomputed, natural "
        "(||r - P_K(r - u^)||), cone and dual_cone (distances from K and K*), each (nc,).\n\n"
        "Raises ProblemError where problem or solution are not valid.");
    m.def(
        "merit", [](const P& p, const Solution& s) { return merit(p, s); }, "problem"_a,
        "solution"_a, nb::call_guard<Unlocked>(),
        "The merit of a solution. A missing v is computed, a missing u is not judged.\n\n"
        "Raises ProblemError where problem or solution are not valid.");
  });
  bind_files(m);
  bind_siconos(m);
}

}  // namespace fclib::bindings
