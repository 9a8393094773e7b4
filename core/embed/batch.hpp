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
  std::int64_t count = 0;            ///< problems
  const std::int32_t* nc = nullptr;  ///< contacts of each (count)
  std::int32_t nc_each = 0;          ///< ... of all of them, where nc is null
  const double* W = nullptr;         ///< of each m x m by rows, m = spacedim nc
  const double* q = nullptr;         ///< of each m
  const double* mu = nullptr;        ///< of each nc
  const double* guess = nullptr;     ///< of r, or null
  // what is found; u and all below may be null
  double* r = nullptr;
  double* u = nullptr;
  std::int32_t* status = nullptr;       ///< (count)
  const std::int32_t* codes = nullptr;  ///< what stands there for each Status; null: its number
  double* error = nullptr;              ///< Merit::error (count)
  std::int32_t* iterations = nullptr;   ///< (count)
};

struct BatchSettings {
  double tolerance = 1e-8;                                      ///< on Merit::error
  int threads = 1;                                              ///< 0: as many as the machine has
  double time_limit = std::numeric_limits<double>::infinity();  ///< wall clock of all [s]
  std::function<bool()> poll;  ///< now and then, in the calling thread; false stops
};

struct BatchOutcome {
  std::int64_t converged = 0;
  std::int64_t by_auto = 0;  ///< problems that went the way of the solver auto
};

/// Solves all of them. Problems that the fast way does not finish are solved by `auto`; a problem
/// is converged where its merit, recomputed in extended precision, is at most the tolerance. What
/// is found does not depend on the number of threads. Problems that time or poll leave undone have
/// r = 0 (or the guess), their merit, and the status time_limit or interrupted.
///
/// Throws Error (problem) that names the first problem of which an entry is not finite, or mu
/// negative; the others' answers are there all the same.
BatchOutcome solve_batch(const Batch& batch, const BatchSettings& settings = {});

}  // namespace fclib
