// Siconos' text files, and the storage of a problem's matrices, in Python.
#pragma once

#include <nanobind/nanobind.h>

namespace fclib::bindings {

/// read_siconos and write_siconos, and the method with_storage of every problem. The classes of
/// problems must be bound before.
void bind_siconos(nanobind::module_& m);

}  // namespace fclib::bindings
