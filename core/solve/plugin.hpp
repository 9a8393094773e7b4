// Solvers of other people in shared objects, through include/fclib_plugin.h.
#pragma once

#include <string>
#include <string_view>
#include <utility>

#include "error.hpp"
#include "solve/solver.hpp"

namespace fclib {

inline constexpr std::string_view plugin_prefix = "plugin:";

/// A solver that is not of fclib failed.
class SolverError : public Error {
 public:
  SolverError(std::string message, std::string where)
      : Error(ErrorKind::unsuitable, std::move(message), std::move(where)) {}
};

/// The solver of the shared object `plugin:PATH`, which stays loaded until the process ends. The
/// caller's thread calls it. Throws Error (option) if it cannot be loaded, or is not a solver.
const Solver& load_plugin(std::string_view name);

}  // namespace fclib
