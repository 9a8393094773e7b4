// The Python module fclib._core: problems, files, solvers and merits.
//
// It loops over the formulations, their fields and the solvers' registry, and names none of them.
#include "module.hpp"

#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>

#include <Eigen/Core>
#include <map>

#include "io/hdf5/library.hpp"
#include "linalg/extended.hpp"
#include "linalg/fronts.hpp"
#include "version.hpp"

NB_MODULE(_core, m) {
  using namespace fclib;
  using namespace fclib::bindings;
  m.doc() = "The core of fclib, in C++.";
  nb::set_leak_warnings(
      false);  // the interpreter itself handles references that a module holds at exit
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
            {"judge", std::string(real_name) + ", " + std::to_string(real_bits) + " bits"},
            {"metis", has_nested_dissection() ? "yes" : ""},
            {"nanobind", dotted(NB_VERSION_MAJOR, NB_VERSION_MINOR, NB_VERSION_PATCH)}};
      },
      "What the core was built with, by its name, and the version of HDF5 that is loaded.\n\n"
      "hdf5_bundled is empty if HDF5 is a library of the system, metis if the core has "
      "none.");
  bind_errors(m);
  bind_arrays(m);
  bind_problems(m);
  bind_conversions(m);
  bind_arrangements(m);
  bind_solvers(m);
  bind_embed(m);
  bind_stepping(m);
  bind_merits(m);
  bind_files(m);
  bind_sequences(m);
}
