// Islands, component orders, planar problems in space and units, in Python.
#pragma once

#include <nanobind/nanobind.h>

namespace fclib::bindings {

/// Islands and merge, component_order, and the methods of problems and solutions that go with them.
/// The classes of problems and Solution must be bound before.
void bind_arrangements(nanobind::module_& m);

}  // namespace fclib::bindings
