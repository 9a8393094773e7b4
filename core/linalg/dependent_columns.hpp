// Which columns of a matrix are combinations of others, to rounding.
#pragma once

#include <vector>

#include "linalg/matrix.hpp"

namespace fclib {

/// The columns of a matrix, those that are left out being combinations of those that are kept.
struct ColumnChoice {
  std::vector<Index> kept;
  std::vector<Index> dropped;
};

/// By a QR factorisation with column pivots, dense where that is small enough, each column scaled
/// to length one: a column is dropped where less than `tolerance` of it is left beside the kept.
ColumnChoice independent_columns(const SparseColumns& a, double tolerance);

/// The same with the factors: A E = Q [T1 T2], with E the scaling, columns in the order kept,
/// dropped.
struct OrthonormalColumns {
  ColumnChoice columns;
  std::vector<Index> rows;  ///< of A that are not empty: those of Q
  Eigen::MatrixXd Q;
  Eigen::MatrixXd T1;  ///< upper triangle
  Eigen::MatrixXd T2;
  Vector scale;  ///< E, in the order of A's columns
};

/// Whether A is small enough to be treated as dense.
bool small_enough_for_dense(const SparseColumns& a);
OrthonormalColumns orthonormal_columns(const SparseColumns& a, double tolerance);

/// A basis of the kernel, up to rounding.
Eigen::MatrixXd kernel(const Eigen::MatrixXd& a);
/// The least x with the least ||A x - b||.
Vector least_solution(const Eigen::MatrixXd& a, const Vector& b);
/// The nearest to x of what these columns span.
Vector projected(const Eigen::MatrixXd& columns, const Vector& x);

}  // namespace fclib
