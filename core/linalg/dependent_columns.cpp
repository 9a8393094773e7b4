#include "linalg/dependent_columns.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/QR>
#include <Eigen/SparseQR>
#include <algorithm>
#include <cmath>

namespace fclib {

namespace {

/// Up to so many entries and multiplications, a dense factorisation is the safe choice.
constexpr double dense_entries = 4e7;
constexpr double dense_flops = 2e10;

std::vector<Index> filled_rows(const SparseColumns& a) {
  std::vector<char> filled(static_cast<std::size_t>(a.rows()), 0);
  for (Eigen::Index col = 0; col < a.outerSize(); ++col) {
    for (SparseColumns::InnerIterator at(a, col); at; ++at) {
      if (at.value() != 0) filled[static_cast<std::size_t>(at.row())] = 1;
    }
  }
  std::vector<Index> rows;
  for (std::size_t row = 0; row < filled.size(); ++row) {
    if (filled[row]) rows.push_back(static_cast<Index>(row));
  }
  return rows;
}

Vector inverse_lengths(const SparseColumns& a) {
  Vector scale(a.cols());
  for (Eigen::Index col = 0; col < a.cols(); ++col) {
    const double length = a.col(col).norm();
    scale[col] = length > 0 ? 1 / length : 1;
  }
  return scale;
}

template <class Permutation>
ColumnChoice choice(const Permutation& order, Eigen::Index rank) {
  ColumnChoice result;
  for (Eigen::Index k = 0; k < order.size(); ++k) {
    (k < rank ? result.kept : result.dropped).push_back(static_cast<Index>(order.indices()[k]));
  }
  return result;
}

}  // namespace

bool small_enough_for_dense(const SparseColumns& a) {
  const auto rows = static_cast<double>(filled_rows(a).size());
  const auto cols = static_cast<double>(a.cols());
  return rows * cols <= dense_entries && 2 * rows * cols * cols <= dense_flops;
}

OrthonormalColumns orthonormal_columns(const SparseColumns& a, double tolerance) {
  OrthonormalColumns result;
  result.rows = filled_rows(a);
  result.scale = inverse_lengths(a);
  std::vector<Index> place(static_cast<std::size_t>(a.rows()), 0);
  for (std::size_t k = 0; k < result.rows.size(); ++k) {
    place[static_cast<std::size_t>(result.rows[k])] = static_cast<Index>(k);
  }
  const auto count = static_cast<Eigen::Index>(result.rows.size());
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(count, a.cols());
  for (Eigen::Index col = 0; col < a.cols(); ++col) {
    for (SparseColumns::InnerIterator at(a, col); at; ++at) {
      if (at.value() == 0) continue;
      dense(place[static_cast<std::size_t>(at.row())], col) = at.value() * result.scale[col];
    }
  }
  if (count == 0) {
    for (Index col = 0; col < static_cast<Index>(a.cols()); ++col) {
      result.columns.dropped.push_back(col);
    }
    result.Q.resize(0, 0);
    result.T1.resize(0, 0);
    result.T2.resize(0, a.cols());
    return result;
  }
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(dense);
  const auto diagonal = qr.matrixQR().diagonal();
  Eigen::Index rank = 0;
  while (rank < diagonal.size() && std::abs(diagonal[rank]) > tolerance) ++rank;
  result.columns = choice(qr.colsPermutation(), rank);
  result.Q = qr.householderQ() * Eigen::MatrixXd::Identity(count, rank);
  result.T1 = qr.matrixQR().topLeftCorner(rank, rank).triangularView<Eigen::Upper>();
  result.T2 = qr.matrixQR().topRightCorner(rank, a.cols() - rank);
  return result;
}

Eigen::MatrixXd kernel(const Eigen::MatrixXd& a) {
  if (a.rows() == 0) return Eigen::MatrixXd::Identity(a.cols(), a.cols());
  Vector size = a.colwise().norm().transpose();
  for (double& value : size) value = value > 0 ? value : 1.0;
  const Eigen::MatrixXd scaled = a * size.cwiseInverse().asDiagonal();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(scaled);
  qr.setThreshold(1e-10);
  const Eigen::Index rank = qr.rank();
  const Eigen::Index free = a.cols() - rank;
  Eigen::MatrixXd basis(a.cols(), free);
  if (free == 0) return basis;
  const Eigen::MatrixXd r = qr.matrixQR().topRows(rank);
  basis.topRows(rank) = -r.leftCols(rank).triangularView<Eigen::Upper>().solve(r.rightCols(free));
  basis.bottomRows(free).setIdentity();
  return size.cwiseInverse().asDiagonal() * (qr.colsPermutation() * basis);
}

Vector least_solution(const Eigen::MatrixXd& a, const Vector& b, std::optional<double> threshold) {
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factors(a.rows(), a.cols());
  if (threshold) factors.setThreshold(*threshold);
  return factors.compute(a).solve(b);
}

Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd& a) {
  return a.completeOrthogonalDecomposition().pseudoInverse();
}

Vector projected(const Eigen::MatrixXd& columns, const Vector& x) {
  return columns * columns.colPivHouseholderQr().solve(x);
}

ColumnChoice independent_columns(const SparseColumns& a, double tolerance) {
  if (small_enough_for_dense(a)) return orthonormal_columns(a, tolerance).columns;
  SparseColumns scaled = a * inverse_lengths(a).asDiagonal();
  scaled.makeCompressed();
  Eigen::SparseQR<SparseColumns, Eigen::COLAMDOrdering<Index>> qr;
  qr.setPivotThreshold(tolerance);
  qr.compute(scaled);
  return choice(qr.colsPermutation(), qr.rank());
}

}  // namespace fclib
