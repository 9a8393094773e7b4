// The equations of a problem, judged component by component.
//
// The residual of an equation has two bounds for each component. The first bound is rounding: what
// double precision leaves of its terms, however much of them cancels, is no mistake of a solution.
// The terms are as large as the data explain, so that a solution cannot hide an error behind large
// reactions of its own. What is left is then relative to a velocity: that of the body, the contact
// or the joint, with the velocities that reactions of the problem's own size give it. Neither the
// size of a neighbour nor a self-stress, which moves nothing, enters that velocity. No contact and
// no joint counts as slower than the root mean square of all: at a body that rests because its
// neighbours hold it, rounding is no mistake.
#pragma once

#include <string_view>
#include <vector>

#include "linalg/extended.hpp"
#include "linalg/factorization.hpp"
#include "problem.hpp"

namespace fclib {

/// A stored v, u or l beside the one that follows from the rest of the solution, at the component
/// with the largest difference.
struct Mismatch {
  std::string_view part;  ///< "v", "u" or "l"
  Index index = 0;        ///< of the component
  double stored = 0;
  double difference = 0;  ///< of v and u; for l, the velocity that is left at its joint [m/s]
  double error = 0;       ///< the difference beyond rounding, over the velocity of its component
};

/// What the equations say of a solution.
struct Equations {
  RealVector u;                      ///< recomputed (m) [m/s]
  std::vector<Mismatch> mismatches;  ///< one of each part that is stored
};

/// What the judgement of the equations needs and depends on the problem alone.
struct OwnSizes {
  RealVector free;     ///< M^-1 f of a global problem (n) [m/s]
  RealVector free_u;   ///< q, condensed (m) [m/s]
  RealVector l;        ///< reactions that stop the joints, each joint alone (p)
  RealVector least_l;  ///< the same, for the velocity least_joint at each; of a global problem (p)
  Real least_joint = 0;  ///< root mean square of s, condensed, of a global problem [m/s]
  RealVector q;          ///< of the terms of u without reactions (m) [m/s]
  RealVector rounding;   ///< what double precision leaves of the terms that q is made of (m)
                         ///< [m/s]; empty if q is given
  RealVector scale;      ///< tr(W_aa) / d of each contact (nc)
  RealVector rho;        ///< of the scaled natural map, for each contact (nc) [1/W]
};

OwnSizes own_sizes(const LocalProblem& problem);
/// `condensed`, if it is there, saves the work for the diagonals of W and R.
OwnSizes own_sizes(const GlobalProblem& problem, const Factorization& mass,
                   const LocalProblem* condensed = nullptr);

Equations equations(const LocalProblem& problem, const Solution& solution, const OwnSizes& own);
Equations equations(const GlobalProblem& problem, const Solution& solution,
                    const Factorization& mass, const OwnSizes& own);

}  // namespace fclib
