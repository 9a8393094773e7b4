// Completes a solution: r (and lambda) give the rest by the equations of the problem, which must be
// valid. Rolling problems have the same equations.
#pragma once

#include "problem.hpp"

namespace fclib {

/// The solution with u = W r + V lambda + q if it has no u.
Solution complete(const LocalProblem& problem, Solution solution);

/// The solution with v = M^-1 (H r + G lambda + f) if it has no v, and u = H^T v + w if it has no
/// u. Throws Error (unsuitable) if M is singular.
Solution complete(const GlobalProblem& problem, Solution solution);

}  // namespace fclib
