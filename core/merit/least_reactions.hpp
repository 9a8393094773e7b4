// The least reactions that do what given ones do.
//
// Bodies that are pressed against each other, and joints that follow from others, carry reactions
// of any size that move nothing. What such reactions round to is no excuse for an error: only the
// reactions that the motion needs are.
#pragma once

#include "linalg/extended.hpp"
#include "linalg/matrix.hpp"

namespace fclib {

/// abs(y) of the y with A y = effect, nearly, whose norm is least; each column of A counts in units
/// of its length. Sizes, not digits: of large matrices a factor of about two is left.
Vector least_reactions(const SparseColumns& a, const RealVector& effect);

}  // namespace fclib
