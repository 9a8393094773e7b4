// Matrices as files and users hold them: triplet, compressed columns or rows, or dense.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstdint>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "field.hpp"

namespace fclib {

using Index = std::int32_t;
using Vector = Eigen::VectorXd;
using ConstVectorRef = Eigen::Ref<const Vector>;
using SparseColumns = Eigen::SparseMatrix<double, Eigen::ColMajor, Index>;

enum class Storage {
  triplet,  ///< i = rows, p = columns, as in CSparse; duplicates add up
  csc,      ///< p = column pointers (cols + 1), i = row indices
  csr,      ///< p = row pointers (rows + 1), i = column indices
  dense,    ///< x by columns (rows * cols), no p, no i
};

/// What is known of a matrix and cannot be seen from its entries at once.
struct MatrixInfo {
  std::string comment;
  double conditioning = 0;  ///< 0 if it is not known
  double determinant = 0;
  Index rank = 0;

  static constexpr auto fields() {
    using S = MatrixInfo;
    return std::tuple{
        Field<S, std::string>{.name = "comment", .member = &S::comment, .doc = "anything"},
        Field<S, double>{.name = "conditioning",
                         .member = &S::conditioning,
                         .doc = "condition number, 0 if it is not known"},
        Field<S, double>{.name = "determinant",
                         .member = &S::determinant,
                         .doc = "determinant, 0 if it is not known"},
        Field<S, Index>{.name = "rank", .member = &S::rank, .doc = "rank, 0 if it is not known"},
    };
  }

  bool operator==(const MatrixInfo&) const = default;
};

/// A real rows x cols matrix in one of four storages, index base 0. Entries may be in any order.
struct Matrix {
  Storage storage = Storage::csr;
  Index rows = 0;
  Index cols = 0;
  std::vector<Index> p = {};
  std::vector<Index> i = {};
  std::vector<double> x = {};
  std::optional<MatrixInfo> info = {};

  /// An empty 0 x 0 matrix stands for "not given".
  [[nodiscard]] bool empty() const { return rows == 0 && cols == 0 && x.empty(); }
  [[nodiscard]] std::size_t nnz() const { return x.size(); }

  bool operator==(const Matrix&) const = default;

  static Matrix from_eigen(const SparseColumns& a);
};

/// Throws Error (problem) if pointers, indices or sizes contradict each other, or if an entry is
/// not finite. `where` names the matrix in the message.
void validate(const Matrix& a, const std::string& where);

/// Whether the indices are sorted and without duplicates in each column or row (true when dense).
bool is_canonical(const Matrix& a);

/// Calls visit(row, col, value) for each stored entry.
template <class Visitor>
void for_each_entry(const Matrix& a, Visitor&& visit) {
  switch (a.storage) {
    case Storage::triplet:
      for (std::size_t k = 0; k < a.x.size(); ++k) visit(a.i[k], a.p[k], a.x[k]);
      break;
    case Storage::csc:
      for (Index col = 0; col < a.cols; ++col)
        for (Index k = a.p[col]; k < a.p[col + 1]; ++k) visit(a.i[k], col, a.x[k]);
      break;
    case Storage::csr:
      for (Index row = 0; row < a.rows; ++row)
        for (Index k = a.p[row]; k < a.p[row + 1]; ++k) visit(row, a.i[k], a.x[k]);
      break;
    case Storage::dense:
      for (std::size_t k = 0; k < a.x.size(); ++k)
        visit(static_cast<Index>(k % a.rows), static_cast<Index>(k / a.rows), a.x[k]);
      break;
  }
}

/// The same matrix in another storage. Duplicates are added up by any change of storage.
Matrix converted(const Matrix& a, Storage storage);

SparseColumns to_eigen(const Matrix& a);

/// y += A x, with x of length cols and y of length rows, in the precision of y.
template <class X, class Y>
void multiply_add(const Matrix& a, const X& x, Y& y) {
  using Real = typename Y::Scalar;
  for_each_entry(a,
                 [&](Index row, Index col, double value) { y[row] += Real(value) * Real(x[col]); });
}
/// y += A^T x, with x of length rows and y of length cols, in the precision of y.
template <class X, class Y>
void multiply_transposed_add(const Matrix& a, const X& x, Y& y) {
  using Real = typename Y::Scalar;
  for_each_entry(a,
                 [&](Index row, Index col, double value) { y[col] += Real(value) * Real(x[row]); });
}

}  // namespace fclib
