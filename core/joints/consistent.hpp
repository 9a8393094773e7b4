// Joints of a closed loop whose rows contradict each other by the rounding of their source alone.
//
// In a loop some rows follow from others. Written in single precision they do so up to its last
// digits, and no velocity satisfies all of them; or one does which the rounding of G made up. With
//
//   E G^T M^-1 G E,   E^-2 = diag(G^T M^-1 G)
//
// rows have length one in the metric of M. Let the columns of Z be its eigenvectors of singular
// values up to a few u, u the precision: combinations of rows that vanish. They must say nothing
// of b either. If what they say, Z^T E b, is no more than u explains of the velocities that the
// rows are made of, the rows become the nearest ones, in this metric, that agree:
//
//   G' = G (I - E Z Z^T E^-1),   b' = (I - E^-1 Z Z^T E) b
//
// This is a function of the problem alone. Solver and merit both take the problem with G' and b'.
//
// u is what the description of the problem states ("precision": 6e-08), or that of single
// precision if all entries of G are such numbers. Else u is that of doubles, and nothing changes.
#pragma once

#include <optional>
#include <string>

#include "problem.hpp"

namespace fclib {

struct ConsistentJoints {
  Matrix G;              ///< (n x p)
  Vector b;              ///< (p) [m/s]
  double moved = 0;      ///< the largest |b' - b| [m/s]
  double precision = 0;  ///< u
  bool stated = false;   ///< whether the problem states it

  /// What was done, in words.
  [[nodiscard]] std::string words() const;
};

/// Nothing if no rows contradict each other, or if they do by more than rounding. Throws Error
/// (unsuitable) where M is singular.
std::optional<ConsistentJoints> consistent_joints(const GlobalProblem& problem);

/// The problem with those joints.
template <class P>
P with(const P& problem, const ConsistentJoints& joints) {
  P result = problem;
  result.G = joints.G;
  result.b = joints.b;
  return result;
}

}  // namespace fclib
