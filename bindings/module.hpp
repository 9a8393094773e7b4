// The parts of the Python module fclib._core, each bound in the file of its name.
#pragma once

#include <nanobind/nanobind.h>

#include <string>
#include <string_view>
#include <vector>

#include "solution.hpp"

namespace fclib::bindings {

namespace nb = nanobind;
using Unlocked = nb::gil_scoped_release;

/// "LocalProblem" for the kind "local".
std::string class_name(std::string_view kind);
/// "GlobalProblem | LocalProblem"
std::string problem_union();

/// What a caller may give as a solution or as a guess: a Solution, a Result, or the reactions
/// alone.
Solution solution_from(nb::handle object, const char* what);
/// ... and as several of them.
std::vector<Solution> solutions_from(const nb::object& given, const std::string& what);
const std::string solution_type = "Solution | Result | numpy.typing.ArrayLike";
const std::string solutions_type =
    "collections.abc.Sequence[" + solution_type + "] | numpy.typing.NDArray[typing.Any]";

/// Lets Ctrl-C through: it returns true or throws.
bool poll_signals();

// in this order, because a signature names classes that must be bound before it

/// Error and what derives from it.
void bind_errors(nb::module_& m);
/// Matrices that are no part of a problem.
void bind_arrays(nb::module_& m);
/// The problems of all formulations, Solution, ProblemInfo and MatrixInfo.
void bind_problems(nb::module_& m);
/// Methods of problems: condense or eliminate, with_storage.
void bind_conversions(nb::module_& m);
/// Islands and merge, component_order, and the methods of problems and solutions that go with them.
void bind_arrangements(nb::module_& m);
/// The registry, solve and what it returns.
void bind_solvers(nb::module_& m);
/// Monitor and python_solver, for solvers written in Python. The driver runs them like those of the
/// core. This is a part of bind_solvers().
void bind_python_solvers(nb::module_& m);
/// Batches of small problems.
void bind_embed(nb::module_& m);
/// The arithmetic of a time step.
void bind_stepping(nb::module_& m);
/// Merit, merit, merit_1 and contact_merits.
void bind_merits(nb::module_& m);
/// Files: HDF5 and the text of Siconos.
void bind_files(nb::module_& m);
/// Files of many problems.
void bind_sequences(nb::module_& m);

}  // namespace fclib::bindings
