// How the solutions of many small local problems change with their data: what fclib.jvp and
// fclib.vjp say of one, in one call for all.
//
// Near a solution Coulomb's law is, contact by contact (fclib/_derivatives.py),
//
//   open    dr = 0
//   stick   rho du = 0
//   slide   rho du_N = 0,   dr_T + mu t dr_N + mu r_N (I - t t^T) / ||u_T|| du_T = -r_N t dmu
//
// that is A du + B dr = c dmu, with du = W dr + dq + dW r. Open contacts are left out, and S = A W
// + B of the others is scaled and factorised with complete pivoting, S = P^T L D U Q^T. If S is
// singular, as redundant contacts make it, its pseudo-inverse follows from the same factors: L and
// U have ones on their diagonals and are well conditioned, D has the small pivots.
//
// The factors that solved the problem are of another matrix: they belong to the iterate before the
// last, and have a proximal term. The factors here serve all right-hand sides of a problem.
//
// A problem of one contact whose S is well conditioned has its derivatives in closed form.
#pragma once

#include <cstdint>
#include <functional>

namespace fclib {

/// Problems and their solutions. The arrays of the problems are those of Batch with a dense W.
struct SolvedBatch {
  int spacedim = 3;                    ///< 2 or 3
  std::int64_t count = 0;              ///< number of problems
  const std::int32_t* nc = nullptr;    ///< contacts of each (count)
  std::int32_t nc_each = 0;            ///< contacts of every problem, if nc is null
  const double* W = nullptr;           ///< (m x m) of each problem, by rows
  const double* q = nullptr;           ///< (m) of each
  const double* mu = nullptr;          ///< (nc) of each
  const double* r = nullptr;           ///< (m) of each
  std::uint8_t* degenerate = nullptr;  ///< (nc) of each: on a border between two statuses, or null
  std::uint8_t* unique = nullptr;      ///< (count) whether the changes are determined, or null
};

/// Weights of r and u, and the derivatives of r . r* + u . u* by the data. `sides` weights a
/// problem, one behind another: (count, sides, m). What is null is not asked for, or zero.
struct Adjoint {
  std::int64_t sides = 1;
  const double* r = nullptr;  ///< (sides, m) of each problem
  const double* u = nullptr;  ///< (sides, m)
  double* W = nullptr;        ///< (sides, m x m, by rows): the entries count as independent
  double* q = nullptr;        ///< (sides, m)
  double* mu = nullptr;       ///< (sides, nc)
};

/// Changes of the data, and those of the solution.
struct Forward {
  std::int64_t sides = 1;
  const double* W = nullptr;   ///< (sides, m x m, by rows) of each problem
  const double* q = nullptr;   ///< (sides, m)
  const double* mu = nullptr;  ///< (sides, nc)
  double* r = nullptr;         ///< (sides, m)
  double* u = nullptr;         ///< (sides, m)
};

/// The derivatives of r themselves: dr = by_q (dq + dW r) + by_mu dmu.
struct Sensitivities {
  double* by_q = nullptr;   ///< (m x m, by rows) of each problem, or null
  double* by_mu = nullptr;  ///< (m x nc, by rows), or null
};

struct DerivativeSettings {
  int threads = 1;               ///< 0: as many as the machine has
  std::function<bool()> poll{};  ///< called now and then in the calling thread; false stops
};

/// A problem whose data or reactions are not finite, or with a negative mu, gets NaN, except that
/// zero weights and zero changes give zeros: such a problem, left out of a loss, changes nothing.
/// Where poll stopped, the results are NaN too.
///
/// Throws Error (problem) if the sizes make no sense.
void adjoint(const SolvedBatch& batch, const Adjoint& what,
             const DerivativeSettings& settings = {});
void forward(const SolvedBatch& batch, const Forward& what,
             const DerivativeSettings& settings = {});
/// Here such a problem has zeros: a matrix cannot know what it is multiplied with.
void sensitivities(const SolvedBatch& batch, const Sensitivities& what,
                   const DerivativeSettings& settings = {});

}  // namespace fclib
