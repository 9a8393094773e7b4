// W by rows, for solvers that need it so, and the error that solvers report.
#pragma once

#include "linalg/matrix.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

/// All d x d blocks, by rows (Storage::csr). The columns of a row are in order. Zeros inside a
/// block are stored.
Matrix by_rows(const BlockMatrix& blocks);

/// The error of r (m) that a tolerance bounds, relative to the problem's scale. It is infinite if r
/// is not finite.
double error_of(const ReducedProblem& problem, const Vector& r);

}  // namespace fclib
