// Which columns of a matrix are combinations of others, up to rounding.
#pragma once

#include <optional>
#include <vector>

#include "linalg/matrix.hpp"

namespace fclib {

/// The columns that are kept. Each of the others, up to rounding, is a combination of them.
struct ColumnChoice {
  std::vector<Index> kept;
  std::vector<Index> dropped;
};

/// By a QR factorisation with column pivots, dense if the matrix is small enough. Each column is
/// scaled to length one. A column is dropped if the part of it that the kept ones do not explain is
/// shorter than `tolerance`.
ColumnChoice independent_columns(const SparseColumns& a, double tolerance);

/// The same with the factors: A E = Q [T1 T2]. E is the scaling; the kept columns come first, then
/// the dropped ones.
struct OrthonormalColumns {
  ColumnChoice columns;
  std::vector<Index> rows;  ///< rows of A that are not empty: the rows of Q
  Eigen::MatrixXd Q;
  Eigen::MatrixXd T1;  ///< upper triangle
  Eigen::MatrixXd T2;
  Vector scale;  ///< E, in the order of A's columns
};

/// Whether A is small enough for a dense factorisation.
bool small_enough_for_dense(const SparseColumns& a);
OrthonormalColumns orthonormal_columns(const SparseColumns& a, double tolerance);

/// A basis of the kernel, up to rounding.
Eigen::MatrixXd kernel(const Eigen::MatrixXd& a);
/// The least x with the least ||A x - b||. Pivots below `threshold` of the largest one count as 0.
/// Without it they do if rounding may have left them.
Vector least_solution(const Eigen::MatrixXd& a, const Vector& b,
                      std::optional<double> threshold = std::nullopt);
/// B with the least ||A B - I||.
Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd& a);
/// The nearest point to x in what these columns span.
Vector projected(const Eigen::MatrixXd& columns, const Vector& x);

}  // namespace fclib
