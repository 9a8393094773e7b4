// Many small problems in one call, from the caller's arrays.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>

#include "linalg/matrix.hpp"
#include "solve/solver.hpp"

namespace fclib {

/// Problems one behind another, all with one law of contact. m = spacedim nc. Either local ones, u
/// = W r + q, or global ones, M v = H r + f and u = H^T v + w.
struct Batch {
  int spacedim = 3;                  ///< 2 or 3; 3 or 5 with mu_r, 4 with mu_s, 6 with both
  std::int64_t count = 0;            ///< number of problems
  const std::int32_t* nc = nullptr;  ///< contacts of each (count)
  std::int32_t nc_each = 0;          ///< contacts of every problem, if nc is null
  // local problems
  const double* W = nullptr;  ///< (m x m) of each problem, by rows; or its blocks
  const double* q = nullptr;  ///< (m) of each problem
  // W by blocks (spacedim x spacedim, each by rows), if starts is not null
  const std::int32_t* starts = nullptr;   ///< (nc + 1) of each problem: the first block of each
                                          ///< contact, the last entry is their number
  const std::int32_t* columns = nullptr;  ///< of each block the other contact
  bool one_pattern = false;               ///< starts and columns are there once, for all
  // global problems, if M is not null
  const std::int32_t* n = nullptr;  ///< degrees of freedom of each (count)
  std::int32_t n_each = 0;          ///< ... of every problem, if n is null
  const double* M = nullptr;        ///< (n x n) of each problem, symmetric
  const double* H = nullptr;        ///< (n x m) of each, by columns: the Jacobian H^T by rows
  const double* f = nullptr;        ///< (n) of each
  const double* w = nullptr;        ///< (m) of each, or null for zeros
  const double* mu = nullptr;       ///< (nc) of each problem
  const double* mu_r = nullptr;     ///< (nc) of each [m], or null: no rolling friction
  const double* mu_s = nullptr;     ///< (nc) of each [m], or null: no spin friction
  bool coupled = false;             ///< sliding and spin share one limit, an ellipsoid
  const double* guess = nullptr;    ///< of r, or null
  // the results; u and all below may be null
  double* r = nullptr;
  double* u = nullptr;
  double* v = nullptr;                  ///< of global problems
  std::int32_t* status = nullptr;       ///< (count)
  const std::int32_t* codes = nullptr;  ///< the number for each Status; null: Status itself
  double* error = nullptr;  ///< (count) at least Merit::error, and at most a thousandth of the
                            ///< tolerance above it
  std::int32_t* iterations = nullptr;  ///< (count)
};

struct BatchSettings {
  double tolerance = 1e-8;                                      ///< on Merit::error
  int threads = 1;                                              ///< 0: as many as the machine has
  double time_limit = std::numeric_limits<double>::infinity();  ///< of the batch, wall clock [s]
  std::function<bool()> poll{};  ///< called now and then in the calling thread; false stops
};

struct BatchOutcome {
  std::int64_t converged = 0;
  std::int64_t by_auto = 0;         ///< problems that the solver auto solved
  std::int64_t invalid = 0;         ///< problems whose data are not valid
  std::int64_t first_invalid = -1;  ///< the first of them
  std::string wrong;                ///< ... and what is wrong with it
};

/// Solves all of them. If the fast way does not finish a problem, `auto` solves it; `auto` solves
/// all with rolling or spin friction. A problem is converged if its merit is at most the tolerance,
/// as extended precision confirms, or double precision with a bound on its rounding. The result
/// does not depend on the number of threads. Problems that time or poll leave undone have r = 0 (or
/// the guess), their merit, and the status time_limit or interrupted. A problem with an entry that
/// is not finite, a negative coefficient of friction, or an M that is not positive definite, has
/// NaN for r, u and v, an infinite error and the status invalid.
///
/// Throws Error (problem) if the sizes make no sense, so that nobody knows where a problem begins.
BatchOutcome solve_batch(const Batch& batch, const BatchSettings& settings = {});

}  // namespace fclib
