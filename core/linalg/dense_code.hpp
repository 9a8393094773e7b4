// The code of linalg/dense_kernels.hpp, for the files that compile it.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

#include "linalg/dense_kernels.hpp"

namespace fclib {

namespace {

using Columns = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
using Column = Eigen::Map<Eigen::VectorXd>;

Columns columns(const DenseView& a) {
  return {a.data, a.rows, a.cols, Eigen::OuterStride<>(a.stride)};
}

/// Calls f(B), where B is a vector if it has one column: Eigen is faster then.
template <class F>
void with_columns(const DenseView& b, const F& f) {
  if (b.cols == 1) {
    Column only(b.data, b.rows);
    f(only);
  } else {
    Columns all = columns(b);
    f(all);
  }
}

/// Below this sum of sizes (Eigen's EIGEN_GEMM_TO_COEFFBASED_THRESHOLD), and for one row, Eigen
/// sums products in an order that depends on the address. The same problem would get other last
/// digits from call to call.
constexpr std::ptrdiff_t least_sizes = 20;

void subtract_product(DenseView c, DenseView a, DenseView b) {
  if (c.rows == 1 || c.rows + c.cols + a.cols < least_sizes) {
    for (std::ptrdiff_t j = 0; j < c.cols; ++j) {
      double* target = c.data + c.stride * j;
      for (std::ptrdiff_t k = 0; k < a.cols; ++k) {
        const double* source = a.data + a.stride * k;
        const double factor = b.data[b.stride * j + k];
        for (std::ptrdiff_t i = 0; i < c.rows; ++i) target[i] -= source[i] * factor;
      }
    }
  } else if (c.cols == 1) {
    Column(c.data, c.rows).noalias() -= columns(a) * Column(b.data, b.rows);
  } else {
    columns(c).noalias() -= columns(a) * columns(b);
  }
}

void solve_unit_lower(DenseView l, DenseView b) {
  with_columns(
      b, [&](auto& x) { columns(l).template triangularView<Eigen::UnitLower>().solveInPlace(x); });
}

void solve_upper(DenseView u, DenseView b) {
  with_columns(
      b, [&](auto& x) { columns(u).template triangularView<Eigen::Upper>().solveInPlace(x); });
}

void solve_upper_from_right(DenseView u, DenseView b) {
  Columns x = columns(b);
  columns(u).triangularView<Eigen::Upper>().solveInPlace<Eigen::OnTheRight>(x);
}

bool eliminate(DenseView all, std::ptrdiff_t start, std::ptrdiff_t end, double tiny,
               int* exchanged) {
  Columns a = columns(all);
  const std::ptrdiff_t n = a.rows();
  for (std::ptrdiff_t k = start; k < end; ++k) {
    std::ptrdiff_t best = k;
    double largest = 0;
    for (std::ptrdiff_t row = k; row < n; ++row) {
      const double value = std::abs(a(row, k));
      if (value > largest) {
        largest = value;
        best = row;
      }
    }
    if (!(largest < std::numeric_limits<double>::infinity())) return false;
    exchanged[k] = static_cast<int>(best);
    if (best != k) a.row(k).swap(a.row(best));
    if (largest <= tiny) a(k, k) = a(k, k) < 0 ? -tiny : tiny;
    const double inverse = 1.0 / a(k, k);
    for (std::ptrdiff_t row = k + 1; row < n; ++row) a(row, k) *= inverse;
    for (std::ptrdiff_t col = k + 1; col < end; ++col) {
      const double factor = a(k, col);
      if (factor == 0) continue;
      for (std::ptrdiff_t row = k + 1; row < n; ++row) a(row, col) -= a(row, k) * factor;
    }
  }
  return true;
}

constexpr DenseKernels kernels{subtract_product, solve_unit_lower, solve_upper,
                               solve_upper_from_right, eliminate};

}  // namespace

}  // namespace fclib
