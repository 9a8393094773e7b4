#include "stepping/joints.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "linalg/factorization.hpp"

namespace fclib::stepping {

namespace {

constexpr Index few = 48;  // up to so many unknowns a full matrix is faster

/// The first entry of each row, and the end.
std::vector<std::size_t> starts_of(const Rows& rows, std::size_t count) {
  std::vector<std::size_t> starts(count + 1, 0);
  for (std::size_t row = 0; row < count; ++row) {
    starts[row + 1] = starts[row] + static_cast<std::size_t>(rows.length[row]);
  }
  return starts;
}

}  // namespace

std::vector<std::int64_t> rows_that_count(const Rows& rows, std::span<const std::int64_t> group,
                                          std::span<const double> rounding, double rank) {
  const std::size_t count = group.size();
  const std::vector<std::size_t> starts = starts_of(rows, count);
  std::vector<double> sizes(count, 0.0), largest;
  double all = 0;
  for (std::size_t row = 0; row < count; ++row) {
    for (std::size_t k = starts[row]; k < starts[row + 1]; ++k) {
      sizes[row] += rows.value[k] * rows.value[k];
    }
    sizes[row] = std::sqrt(sizes[row]);
    const auto own = static_cast<std::size_t>(group[row]);
    if (own >= largest.size()) largest.resize(own + 1, 0.0);
    largest[own] = std::max(largest[own], sizes[row]);
    all = std::max(all, sizes[row]);
  }
  std::vector<std::int64_t> kept;
  for (std::size_t row = 0; row < count; ++row) {
    const bool small = sizes[row] <= rank * largest[static_cast<std::size_t>(group[row])];
    // an equality of bodies that cannot move
    const bool still = sizes[row] <= rank * all && sizes[row] <= rounding[row];
    if (!small && !still) kept.push_back(static_cast<std::int64_t>(row));
  }
  return kept;
}

Matrix columns_of_rows(const Rows& rows, std::span<const std::int64_t> which) {
  const std::size_t count = which.empty() ? 0 : static_cast<std::size_t>(which.back()) + 1;
  const std::vector<std::size_t> starts = starts_of(rows, count);
  Matrix made;
  made.storage = Storage::csc;
  made.rows = rows.columns;
  made.cols = static_cast<Index>(which.size());
  made.p.push_back(0);
  for (const std::int64_t number : which) {
    const auto row = static_cast<std::size_t>(number);
    for (std::size_t k = starts[row]; k < starts[row + 1]; ++k) {
      if (rows.value[k] == 0) continue;
      made.i.push_back(rows.column[k]);
      made.x.push_back(rows.value[k]);
    }
    made.p.push_back(static_cast<Index>(made.i.size()));
  }
  return made;
}

bool are_independent(const Columns& G, std::span<const double> violation,
                     std::span<const double> rounding, const Bounds& bounds) {
  const Index p = G.cols;
  if (p > G.rows) return false;
  if (p == 0) return true;
  Vector sizes = Vector::Zero(p);
  double opening = 0;
  for (Index col = 0; col < p; ++col) {
    for (Index k = G.start(col); k < G.start(col + 1); ++k) sizes[col] += G.x[k] * G.x[k];
    sizes[col] = std::sqrt(sizes[col]);
    if (!(sizes[col] > 0)) return false;
    opening = std::max(opening, std::abs(violation[static_cast<std::size_t>(col)]) / sizes[col]);
  }
  double bound = bounds.singular;
  for (Index col = 0; col < p; ++col) {
    const double blur =
        rounding[static_cast<std::size_t>(col)] / sizes[col] + bounds.turned * opening;
    bound = std::max(bound, std::clamp(blur, bounds.rank, bounds.own));
  }
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(p, p);
  Vector spread = Vector::Zero(G.rows);
  // the columns with an entry in each row, if that is quicker than full columns
  SparseColumns scaled(G.rows, p);
  scaled.resizeNonZeros(G.nnz());
  std::copy(G.p, G.p + p + 1, scaled.outerIndexPtr());
  std::copy(G.i, G.i + G.nnz(), scaled.innerIndexPtr());
  for (Index col = 0; col < p; ++col) {
    for (Index k = G.start(col); k < G.start(col + 1); ++k) {
      scaled.valuePtr()[k] = G.x[k] / sizes[col];
    }
  }
  if (p <= few) {
    for (Index col = 0; col < p; ++col) {
      for (Index k = G.start(col); k < G.start(col + 1); ++k)
        spread[G.i[k]] += scaled.valuePtr()[k];
      for (Index other = col; other < p; ++other) {
        double sum = 0;
        for (Index k = G.start(other); k < G.start(other + 1); ++k) {
          sum += scaled.valuePtr()[k] * spread[G.i[k]];
        }
        gram(other, col) = sum;
      }
      for (Index k = G.start(col); k < G.start(col + 1); ++k) spread[G.i[k]] = 0;
    }
  } else {
    gram = Eigen::MatrixXd(SparseColumns(scaled.transpose()) * scaled);
  }
  gram.diagonal().array() -= 2 * bound * bound;
  return gram.selfadjointView<Eigen::Lower>().llt().info() == Eigen::Success;
}

Vector solution_of(const Columns& A, ConstVectorRef b) {
  if (A.rows <= few) {
    Eigen::MatrixXd full = Eigen::MatrixXd::Zero(A.rows, A.cols);
    for (Index col = 0; col < A.cols; ++col) {
      for (Index k = A.start(col); k < A.start(col + 1); ++k) full(A.i[k], col) += A.x[k];
    }
    return full.partialPivLu().solve(b);
  }
  Matrix own;
  own.storage = Storage::csc;
  own.rows = own.cols = A.rows;
  own.p.assign(A.p, A.p + A.cols + 1);
  own.i.assign(A.i, A.i + A.nnz());
  own.x.assign(A.x, A.x + A.nnz());
  return Factorization(to_eigen(own), "M").solve(b);
}

}  // namespace fclib::stepping
