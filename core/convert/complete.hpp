// Completing a solution: what follows from r (and lambda) by the equations of the problem, which
// must be valid. Rolling problems have the same equations.
#pragma once

#include "problem.hpp"

namespace fclib {

/// The solution with u = W r + V lambda + q where it has no u.
Solution complete(const LocalProblem& problem, Solution solution);

/// The solution with v = M^-1 (H r + G lambda + f) where it has no v, and u = H^T v + w where it
/// has no u. Throws Error (unsuitable) where M is singular.
Solution complete(const GlobalProblem& problem, Solution solution);

}  // namespace fclib
