// The bilateral rows of a step: which count, and whether they are independent.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stepping/columns.hpp"
#include "stepping/rigid.hpp"

namespace fclib::stepping {

/// Bounds of rows of length one.
struct Bounds {
  double rank = 0;      ///< rest of a row that follows from others, if all numbers were exact
  double own = 0;       ///< a row with a larger rest is independent
  double turned = 0;    ///< the rest may be so many times the angle by which a loop is open
  double singular = 0;  ///< A^T A tells larger singular values from zero
};

/// Which of the first rows of a Jacobian are not zero beside others of their group.
///
/// group     of each row, from 0
/// rounding  (rows) a row may vanish if it is no larger
std::vector<std::int64_t> rows_that_count(const Rows& rows, std::span<const std::int64_t> group,
                                          std::span<const double> rounding, double rank);

/// Some rows of a Jacobian, as columns without zeros.
Matrix columns_of_rows(const Rows& rows, std::span<const std::int64_t> which);

/// Whether no column of G (n x p) follows from others.
///
/// The rest of a column of length one, after others, is at least the smallest singular value of
/// all. That is above a bound if A^T A minus the bound's square on the diagonal has a Cholesky
/// factor.
///
/// violation, rounding   (p) of each column
bool are_independent(const Columns& G, std::span<const double> violation,
                     std::span<const double> rounding, const Bounds& bounds);

/// x with A x = b. Throws Error (unsuitable) if A is singular.
Vector solution_of(const Columns& A, ConstVectorRef b);

}  // namespace fclib::stepping
