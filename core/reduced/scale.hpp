// The size of the blocks of W. If masses differ, steps, weights and regularisations are measured by
// it.
#pragma once

#include "reduced/reduced_problem.hpp"

namespace fclib {

/// tr(W_aa) / d of each contact (nc) [W]: the mean of its diagonal.
Vector mean_diagonals(const ReducedProblem& problem);

/// Their mean [W]. 1 if it is not positive.
double mean_diagonal(const ReducedProblem& problem);

/// mean_diagonals (nc) [W]. Each one that is not positive is replaced by the mean of the positive
/// ones; by 1 if there are none.
Vector contact_weights(const ReducedProblem& problem);

}  // namespace fclib
