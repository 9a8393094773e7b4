// The size of the blocks of W, by which steps, weights and regularisations are measured where
// masses differ.
#pragma once

#include "reduced/reduced_problem.hpp"

namespace fclib {

/// tr(W_aa) / d of each contact (nc) [W]: the mean of its diagonal.
Vector mean_diagonals(const ReducedProblem& problem);

/// Their mean [W]; 1 where it is not positive.
double mean_diagonal(const ReducedProblem& problem);

/// mean_diagonals, with the mean of the positive ones in the place of those that are not positive
/// (nc) [W]; 1 where none is.
Vector contact_weights(const ReducedProblem& problem);

}  // namespace fclib
