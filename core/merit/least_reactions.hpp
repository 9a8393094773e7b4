// The smallest reactions with the same effect as given ones.
//
// Bodies that are pressed against each other, and joints that follow from others, can carry
// reactions of any size that move nothing. The rounding of such reactions is no excuse for an
// error. Only the reactions that the motion needs count.
#pragma once

#include "linalg/extended.hpp"
#include "linalg/matrix.hpp"

namespace fclib {

/// abs(y) of the y with A y = effect (nearly) whose norm is smallest. Each column of A is scaled to
/// length one first. The result gives sizes, not digits: for large matrices it is right to a factor
/// of about two.
Vector least_reactions(const SparseColumns& a, const RealVector& effect);

}  // namespace fclib
