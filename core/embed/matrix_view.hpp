// A matrix in the caller's arrays.
#pragma once

#include <cmath>
#include <cstdint>

#include "linalg/matrix.hpp"

namespace fclib {

/// A matrix with the members of Matrix.
struct MatrixView {
  Storage storage = Storage::dense;
  Index rows = 0;
  Index cols = 0;
  std::int64_t nnz = 0;
  const Index* p = nullptr;
  const Index* i = nullptr;
  const double* x = nullptr;

  MatrixView() = default;
  explicit MatrixView(const Matrix& a)
      : storage(a.storage),
        rows(a.rows),
        cols(a.cols),
        nnz(static_cast<std::int64_t>(a.x.size())),
        p(a.p.data()),
        i(a.i.data()),
        x(a.x.data()) {}

  /// Calls visit(row, col, value) for each stored entry. Each index is checked to be in range and
  /// each value to be finite. Returns what is wrong, or null.
  template <class Visitor>
  const char* visit(const Visitor& visit) const {
    const auto entry = [&](Index row, Index col, double value) {
      if (row < 0 || row >= rows || col < 0 || col >= cols) return false;
      visit(row, col, value);
      return std::isfinite(value);
    };
    constexpr const char* wrong = "has an entry that is not finite, or an index out of range";
    switch (storage) {
      case Storage::triplet:
        for (std::int64_t k = 0; k < nnz; ++k) {
          if (!entry(i[k], p[k], x[k])) return wrong;
        }
        return nullptr;
      case Storage::dense:
        for (Index col = 0; col < cols; ++col) {
          for (Index row = 0; row < rows; ++row) {
            if (!entry(row, col, x[static_cast<std::int64_t>(rows) * col + row])) return wrong;
          }
        }
        return nullptr;
      case Storage::csc:
      case Storage::csr:
        break;
    }
    const bool by_columns = storage == Storage::csc;
    const Index outer = by_columns ? cols : rows;
    if (outer == 0 && nnz == 0) return nullptr;  // an empty matrix needs no pointers
    if (p[0] != 0 || p[outer] != nnz) return "has pointers that do not agree with its entries";
    for (Index k = 0; k < outer; ++k) {
      if (p[k] > p[k + 1] || p[k + 1] > nnz) return "has pointers that are not in order";
      for (Index at = p[k]; at < p[k + 1]; ++at) {
        if (!(by_columns ? entry(i[at], k, x[at]) : entry(k, i[at], x[at]))) return wrong;
      }
    }
    return nullptr;
  }
};

}  // namespace fclib
