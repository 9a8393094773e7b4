// Proofs that a problem has no solution, checked on its data as they were given.
//
// u^ is in K* exactly where u_N >= 0. So by Farkas' lemma there is no solution where some y >= 0
// (one number a contact) and z (one a bilateral constraint) have, with E y the vector whose normal
// parts are y,
//
//   local    -(W^T E y + V z) in K*,  V^T E y + R^T z = 0,  y . q_N + z . s < 0
//   global   H E y + G z = 0,                               y . w_N + z . b < 0
//
// For a global problem M and f do not matter: no motion that the joints allow keeps the contacts
// from closing. (More is never needed where M is symmetric positive definite.)
//
// All sums are exact (linalg/exact_sum.hpp), and a proof holds for the doubles that the data are.
// Doubles are too coarse for a y whose sums vanish where normals are at any angle. Of a global
// problem it is enough, then, that real numbers next to y and z are a proof, which bounds of all
// rounding show: fclib.analysis finds them as rational numbers.
//
// A W that was condensed carries the rounding of that, so that W E y does not vanish although it
// did before. Such a y is accepted only for a local problem without bilateral constraints, where
//
//   - what is left of W^T E y is not more than the last digits of W (its terms' rounding), and
//   - y . W_NN y < 0: this W is not positive semidefinite, so it is a rounded one. For any W that
//     is, what is left is a velocity that the contacts can have, and nothing is claimed.
//
// Then the statement is that no reactions of a norm below `bound` are a solution; it is exact too.
#pragma once

#include <functional>
#include <limits>

#include "problem.hpp"

namespace fclib {

/// Of ||q||, the condensed one: what closes more slowly than this (the gain over ||y||) is within
/// the tolerance of solutions, and q may have it from rounding. Of a local problem it proves
/// nothing here; of a global one, whose q is not at hand, it is for the caller to say so.
constexpr double least_speed = 1e-6;

struct NoSolution {
  Vector y;             ///< (nc) >= 0; empty where nothing is proven
  Vector z;             ///< (p)
  double gain = 0;      ///< -(y . q_N + z . s) or -(y . w_N + z . b), positive
  double distance = 0;  ///< of -(W^T E y + V z) from K*, from above
  double bound = 0;  ///< of ||r||, below which there is no solution; infinity where there is none

  [[nodiscard]] bool proven() const { return y.size() > 0; }
  /// There is none, of whatever norm.
  [[nodiscard]] bool exact() const { return bound == std::numeric_limits<double>::infinity(); }
};

/// What y and z, or real numbers next to them, prove; nothing where they do not fit.
NoSolution check_no_solution(const LocalProblem& problem, const Vector& y, const Vector& z = {});
NoSolution check_no_solution(const LocalRollingProblem& problem, const Vector& y,
                             const Vector& z = {});
NoSolution check_no_solution(const GlobalProblem& problem, const Vector& y, const Vector& z = {});

/// A proof near y, which an iteration found: z is added, and both are brought to where the sums
/// vanish exactly, on as few contacts as possible.
NoSolution prove_no_solution(const LocalProblem& problem, const Vector& y);
NoSolution prove_no_solution(const LocalRollingProblem& problem, const Vector& y);
NoSolution prove_no_solution(const GlobalProblem& problem, const Vector& y);

}  // namespace fclib
