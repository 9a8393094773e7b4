// Many small problems in one call, from the caller's arrays.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>

#include "linalg/matrix.hpp"
#include "solve/solver.hpp"

namespace fclib {

/// Local problems, one behind another: u = W r + q and Coulomb's law.
struct Batch {
  int spacedim = 3;                  ///< 2 or 3
  std::int64_t count = 0;            ///< number of problems
  const std::int32_t* nc = nullptr;  ///< contacts of each (count)
  std::int32_t nc_each = 0;          ///< contacts of every problem, if nc is null
  const double* W = nullptr;         ///< (m x m) of each problem, by rows, m = spacedim nc
  const double* q = nullptr;         ///< (m) of each problem
  const double* mu = nullptr;        ///< (nc) of each problem
  const double* guess = nullptr;     ///< of r, or null
  // the results; u and all below may be null
  double* r = nullptr;
  double* u = nullptr;
  std::int32_t* status = nullptr;       ///< (count)
  const std::int32_t* codes = nullptr;  ///< the number for each Status; null: Status itself
  double* error = nullptr;              ///< Merit::error (count)
  std::int32_t* iterations = nullptr;   ///< (count)
};

struct BatchSettings {
  double tolerance = 1e-8;                                      ///< on Merit::error
  int threads = 1;                                              ///< 0: as many as the machine has
  double time_limit = std::numeric_limits<double>::infinity();  ///< of the batch, wall clock [s]
  std::function<bool()> poll{};  ///< called now and then in the calling thread; false stops
};

struct BatchOutcome {
  std::int64_t converged = 0;
  std::int64_t by_auto = 0;  ///< problems that the solver auto solved
};

/// Solves all of them. If the fast way does not finish a problem, `auto` solves it. A problem is
/// converged if its merit, recomputed in extended precision, is at most the tolerance. The result
/// does not depend on the number of threads. Problems that time or poll leave undone have r = 0 (or
/// the guess), their merit, and the status time_limit or interrupted.
///
/// Throws Error (problem) that names the first problem with an entry that is not finite or a
/// negative mu. The answers of the other problems are there all the same.
BatchOutcome solve_batch(const Batch& batch, const BatchSettings& settings = {});

}  // namespace fclib
