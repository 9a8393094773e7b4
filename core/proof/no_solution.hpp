// Proofs that a problem has no solution, checked on its data as given.
//
// u^ is in K* exactly if u_N >= 0. So by Farkas' lemma there is no solution if there are y >= 0
// (one number for each contact) and z (one for each bilateral constraint) as follows. E y is the
// vector whose normal parts are y.
//
//   local    -(W^T E y + V z) in K*,  V^T E y + R^T z = 0,  y . q_N + z . s < 0
//   global   H E y + G z = 0,                               y . w_N + z . b < 0
//
// For a global problem M and f do not matter: no motion that the joints allow keeps the contacts
// from closing. (If M is symmetric positive definite, a proof never needs more.)
//
// All sums are exact (linalg/exact_sum.hpp), and a proof holds for the doubles that are the data.
// If normals are at any angle, no y made of doubles may have sums that vanish exactly. So for a
// global problem it is enough that real numbers next to y and z are a proof; bounds of all rounding
// show that they exist. fclib.analysis finds them as rational numbers.
//
// If W was condensed, it carries rounding, and W E y no longer vanishes. Such a y is accepted only
// for a local problem without bilateral constraints, and only if
//
//   - what is left of W^T E y is not more than the last digits of W (its terms' rounding), and
//   - y . W_NN y < 0: this W is not positive semidefinite, so it is a rounded one. If W is positive
//     semidefinite, what is left is a velocity that the contacts can have, and nothing is claimed.
//
// Then the statement is that no reactions with a norm below `bound` are a solution. It is exact
// too.
#pragma once

#include <functional>
#include <limits>

#include "problem.hpp"

namespace fclib {

/// A gain over ||y|| below this share of ||q||, the condensed one, is within the tolerance of
/// solutions, and q may have it from rounding. For a local problem, it proves nothing here. For a
/// global one, q is not known here, so the caller must check this.
constexpr double least_speed = 1e-6;

struct NoSolution {
  Vector y;             ///< (nc) >= 0; empty if nothing is proven
  Vector z;             ///< (p)
  double gain = 0;      ///< -(y . q_N + z . s) or -(y . w_N + z . b), positive
  double distance = 0;  ///< of -(W^T E y + V z) from K*, an upper bound
  double bound = 0;     ///< no r with a norm below this is a solution; infinity: no r at all is

  [[nodiscard]] bool proven() const { return y.size() > 0; }
  /// There is no solution, whatever its norm.
  [[nodiscard]] bool exact() const { return bound == std::numeric_limits<double>::infinity(); }
};

/// What y and z, or real numbers next to them, prove. Nothing if they have the wrong sizes.
template <class P>
NoSolution check_no_solution(const P& problem, const Vector& y, const Vector& z = {});

/// A proof near y, which an iteration found. z is computed, and both are changed until the sums
/// vanish exactly, on as few contacts as possible.
template <class P>
NoSolution prove_no_solution(const P& problem, const Vector& y);

#define FCLIB_DECLARE(P)                                                                   \
  extern template NoSolution check_no_solution<P>(const P&, const Vector&, const Vector&); \
  extern template NoSolution prove_no_solution<P>(const P&, const Vector&);
FCLIB_FOR_EACH_FORMULATION(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
