// A square matrix of d x d blocks, one block row and column a contact: how solvers hold W.
//
// It is stored by block columns, because Gauss-Seidel changes one reaction at a time and then adds
// W(:, k) delta to the velocities. If the reaction of a contact does not change, it costs nothing.
// The blocks of a column stand one after another, each by columns. If most blocks are there anyway
// (small problems), the whole matrix is dense by columns and has no index.
#pragma once

#include <cstring>
#include <vector>

#include "linalg/matrix.hpp"
#include "linalg/workers.hpp"

namespace fclib {

class BlockMatrix {
 public:
  BlockMatrix() = default;
  /// From a (d nc) x (d nc) matrix in any storage.
  BlockMatrix(const Matrix& a, int d);

  [[nodiscard]] int block_size() const { return d_; }
  [[nodiscard]] Index block_count() const { return nc_; }
  [[nodiscard]] bool dense() const { return dense_; }
  /// Numbers stored.
  [[nodiscard]] std::size_t entries() const { return values_.size(); }

  /// The diagonal block of a contact, D x D by columns. It is zero if the matrix has none.
  template <int D>
  [[nodiscard]] Eigen::Matrix<double, D, D> diagonal_block(Index contact) const {
    using Block = Eigen::Matrix<double, D, D>;
    if (dense_) {
      const Eigen::Index m = Eigen::Index{D} * nc_;
      const double* first = values_.data() + (m + 1) * D * contact;
      return Eigen::Map<const Block, 0, Eigen::OuterStride<>>(first, Eigen::OuterStride<>(m));
    }
    return Eigen::Map<const Block>(values_.data() + std::size_t{D * D} * diagonal_[contact]);
  }

  /// y += W(:, contact) delta, with delta of length D and y of length D nc.
  template <int D>
  void add_column(Index contact, const double* delta, double* y) const;

  /// y = W x + q, all of length d nc. Workers share the rows. The order of each sum is fixed.
  void multiply_add(const Vector& x, const Vector& q, Vector& y, Workers* workers = nullptr) const;

  /// Calls visit(row, col, block) for each stored block, a D x D matrix.
  template <int D, class Visitor>
  void for_each_block(Visitor&& visit) const;

  /// Groups of contacts that no block links: the number of the group of each contact. Groups are
  /// numbered by their first contact.
  [[nodiscard]] std::vector<Index> components() const;

  /// F A F, if F is diagonal with these entries (d nc).
  [[nodiscard]] BlockMatrix scaled(const Vector& factors) const;

  /// The rows and columns of these contacts, which must be a union of whole groups.
  [[nodiscard]] BlockMatrix restricted(const std::vector<Index>& contacts) const;

 private:
  template <int D>
  void fill(const Matrix& a);

  /// y += W(rows of these blocks of a column) x. y starts at its own beginning.
  template <int D>
  void add_blocks(std::size_t first, std::size_t last, const double* x, double* y) const;

  /// y = W x + q for the block rows from `first` up to `last`.
  template <int D>
  void multiply_rows(Index first, Index last, const Vector& x, const Vector& q, Vector& y) const;

  int d_ = 3;
  Index nc_ = 0;
  bool dense_ = false;
  std::vector<std::size_t> column_;    // first block of each column (nc + 1)
  std::vector<Index> row_;             // block row of each block
  std::vector<std::size_t> diagonal_;  // position of each diagonal block (nc)
  std::vector<double> values_;
};

template <int D, class Visitor>
void BlockMatrix::for_each_block(Visitor&& visit) const {
  using Block = Eigen::Map<const Eigen::Matrix<double, D, D>, 0, Eigen::OuterStride<>>;
  const Eigen::Index m = Eigen::Index{D} * nc_;
  for (Index col = 0; col < nc_; ++col) {
    if (dense_) {
      const double* column = values_.data() + m * D * col;
      for (Index row = 0; row < nc_; ++row) {
        visit(row, col, Block(column + std::ptrdiff_t{D} * row, Eigen::OuterStride<>(m)));
      }
    } else {
      for (std::size_t k = column_[col]; k < column_[col + 1]; ++k) {
        visit(row_[k], col,
              Block(values_.data() + std::size_t{D * D} * k, Eigen::OuterStride<>(D)));
      }
    }
  }
}

template <int D>
inline void BlockMatrix::add_column(Index contact, const double* delta,
                                    double* __restrict y) const {
  double x[D];
  for (int c = 0; c < D; ++c) x[c] = delta[c];
  if (dense_) {
    const std::size_t m = std::size_t{D} * static_cast<std::size_t>(nc_);
    const double* column = values_.data() + m * D * static_cast<std::size_t>(contact);
    for (std::size_t row = 0; row < m; ++row) {
      double sum = y[row];
      for (int c = 0; c < D; ++c) sum += column[row + static_cast<std::size_t>(c) * m] * x[c];
      y[row] = sum;
    }
    return;
  }
  add_blocks<D>(column_[contact], column_[contact + 1], x, y);
}

template <int D>
inline void BlockMatrix::add_blocks(std::size_t first, std::size_t last, const double* x,
                                    double* __restrict y) const {
  const double* block = values_.data() + std::size_t{D * D} * first;
  for (std::size_t k = first; k < last; ++k, block += D * D) {
    double* target = y + std::ptrdiff_t{D} * row_[k];
#ifdef __GNUC__
    if constexpr (D == 3) {
      // two rows at once; compilers do not find this by themselves
      using Pair = double __attribute__((vector_size(16)));
      // copied, since rows lie at any multiple of 8 bytes: clang takes a Pair to lie at one of 16
      const auto pair = [](const double* p) {
        Pair copy;
        std::memcpy(&copy, p, sizeof copy);
        return copy;
      };
      Pair upper = pair(target);
      double lower = target[2];
      for (int c = 0; c < D; ++c) {
        upper += pair(block + D * c) * x[c];
        lower += block[D * c + 2] * x[c];
      }
      std::memcpy(target, &upper, sizeof upper);
      target[2] = lower;
      continue;
    }
#endif
    for (int r = 0; r < D; ++r) {
      for (int c = 0; c < D; ++c) target[r] += block[r + D * c] * x[c];
    }
  }
}

}  // namespace fclib
