// Matrices by columns in arrays of others, and the few operations of a time step on them.
//
// Sums are taken entry after entry in the order of storage, so that a problem is the same to the
// last bit, whoever makes it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "linalg/matrix.hpp"

namespace fclib::stepping {

/// A matrix by columns; its arrays live elsewhere.
struct Columns {
  Index rows = 0;
  Index cols = 0;
  const Index* p = nullptr;  ///< pointers (cols + 1), null if there are no entries
  const Index* i = nullptr;
  const double* x = nullptr;

  [[nodiscard]] Index start(Index col) const { return p == nullptr ? 0 : p[col]; }
  [[nodiscard]] Index nnz() const { return start(cols); }
};

/// The view of a matrix that is stored by columns.
Columns columns_of(const Matrix& a);

/// y += A x
void add_product(const Columns& a, std::span<const double> x, std::span<double> y);
/// (A^T x)_col
double product(const Columns& a, Index col, std::span<const double> x);

/// A + factor B, by rows in order in each column, without zeros. A itself if B has no entries.
Matrix sum(const Columns& a, double factor, const Columns& b);

/// A matrix by columns, of `rows` rows, of the values of some numbers; those that are 0 are left
/// out. `row` has the row of each, and `start` where each column starts, and the end.
Matrix chosen_entries(std::span<const double> values, std::span<const std::int64_t> number,
                      std::span<const Index> row, std::span<const Index> start, Index rows);

/// Some columns of a matrix. With `number` (rows), the row r becomes number[r] of `rows` ones, and
/// it is left out if that is negative.
Matrix part(const Columns& a, std::span<const Index> columns, std::span<const Index> number = {},
            Index rows = 0);

}  // namespace fclib::stepping
