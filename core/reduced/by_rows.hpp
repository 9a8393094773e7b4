// W of solvers that want it by rows, and the error that they are told.
#pragma once

#include "linalg/matrix.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

/// All d x d blocks, by rows (Storage::csr), the columns of a row in their order; what is zero in a
/// block is stored.
Matrix by_rows(const BlockMatrix& blocks);

/// The error of r (m) that a tolerance bounds, relative to the problem's scale; infinite where r is
/// not finite.
double error_of(const ReducedProblem& problem, const Vector& r);

}  // namespace fclib
