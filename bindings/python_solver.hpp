// Solvers written in Python, which the driver runs like those of the core.
#pragma once

#include <nanobind/nanobind.h>

namespace fclib::bindings {

/// Monitor and python_solver. The classes of problems, options and solvers must be bound before.
void bind_python_solvers(nanobind::module_& m);

}  // namespace fclib::bindings
