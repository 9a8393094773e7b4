// Closed loops of joints whose rows contradict each other only by the rounding of their source.
//
// In a loop some rows follow from others. If they were written in single precision, they do so only
// up to their last digits. Then no velocity satisfies all of them, or only one that the rounding of
// G made up. With
//
//   E G^T M^-1 G E,   E^-2 = diag(G^T M^-1 G)
//
// rows have length one in the metric of M. u is the precision of the source. Let the columns of Z
// be the eigenvectors of this matrix whose singular values are at most a few u: combinations of
// rows that vanish. Then b must vanish in the same combinations. What they say, Z^T E b, may be no
// more than u explains from the velocities in the rows. If so, the rows become the nearest ones, in
// this metric, that agree:
//
//   G' = G (I - E Z Z^T E^-1),   b' = (I - E^-1 Z Z^T E) b
//
// G' and b' depend on the problem alone. Both solver and merit use the problem with G' and b'.
//
// u is what the description of the problem states ("precision": 6e-08). Without that, if all
// entries of G are numbers of single precision, u is that precision. Else u is that of doubles, and
// nothing changes.
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

/// Nothing if no rows contradict each other, or if they do so by more than rounding. Throws Error
/// (unsuitable) if M is singular.
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
