#include "linalg/matrix.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "error.hpp"
#include "linalg/places.hpp"

namespace fclib {

namespace {

[[noreturn]] void invalid(const std::string& where, const std::string& message) {
  throw Error(ErrorKind::problem, message, where);
}

void require_length(std::size_t actual, std::size_t expected, const std::string& where,
                    const char* array, const char* what) {
  if (actual != expected) {
    invalid(where + array, std::string(what) + " has " + std::to_string(actual) +
                               " entries, expected " + std::to_string(expected));
  }
}

void require_indices(const std::vector<Index>& indices, Index bound, const std::string& where,
                     const char* array) {
  for (std::size_t k = 0; k < indices.size(); ++k) {
    if (indices[k] < 0 || indices[k] >= bound) {
      invalid(
          where + array + "[" + std::to_string(k) + "]",
          "index " + std::to_string(indices[k]) + " is outside 0.." + std::to_string(bound - 1));
    }
  }
}

void require_pointers(const Matrix& a, Index count, const std::string& where) {
  require_length(a.p.size(), static_cast<std::size_t>(count) + 1, where, "/p", "the pointer array");
  if (a.p.front() != 0) invalid(where + "/p[0]", "the first pointer must be 0");
  for (std::size_t k = 1; k < a.p.size(); ++k) {
    if (a.p[k] < a.p[k - 1]) {
      invalid(where + "/p[" + std::to_string(k) + "]", "pointers must not decrease");
    }
  }
  require_length(a.i.size(), static_cast<std::size_t>(a.p.back()), where, "/i", "the index array");
  require_length(a.x.size(), static_cast<std::size_t>(a.p.back()), where, "/x", "the value array");
}

/// Entries at the same place are added up, and no double may hold their sum.
void require_finite_sums(const Matrix& a, const std::string& where) {
  double sum = 0;
  for (const double value : a.x) sum += std::abs(value);
  if (std::isfinite(sum) || is_canonical(a)) return;
  const SparseColumns added = to_eigen(a);
  std::size_t k = 0;
  for_each_entry(a, [&](Index row, Index col, double) {
    if (!std::isfinite(added.coeff(row, col))) {
      invalid(where + "/x[" + std::to_string(k) + "]",
              "the sum of the entries in row " + std::to_string(row) + ", column " +
                  std::to_string(col) + " is not a finite number");
    }
    ++k;
  });
}

}  // namespace

void validate_places(const Matrix& a, const std::string& where) {
  if (a.rows < 0 || a.cols < 0) invalid(where, "a size is negative");
  switch (a.storage) {
    case Storage::triplet:
      require_length(a.i.size(), a.x.size(), where, "/i", "the row index array");
      require_length(a.p.size(), a.x.size(), where, "/p", "the column index array");
      require_indices(a.i, a.rows, where, "/i");
      require_indices(a.p, a.cols, where, "/p");
      break;
    case Storage::csc:
      require_pointers(a, a.cols, where);
      require_indices(a.i, a.rows, where, "/i");
      break;
    case Storage::csr:
      require_pointers(a, a.rows, where);
      require_indices(a.i, a.cols, where, "/i");
      break;
    case Storage::dense:
      require_length(a.x.size(),
                     static_cast<std::size_t>(a.rows) * static_cast<std::size_t>(a.cols), where,
                     "/x", "the value array");
      break;
  }
}

void validate(const Matrix& a, const std::string& where) {
  validate_places(a, where);
  for (std::size_t k = 0; k < a.x.size(); ++k) {
    if (!std::isfinite(a.x[k])) {
      invalid(where + "/x[" + std::to_string(k) + "]", "the value is not a finite number");
    }
  }
  require_finite_sums(a, where);
}

void require_counted(std::span<const double> x, std::size_t counted, const std::string& counter) {
  if (counted > 0 || x.size() <= 1) return;
  const auto given = std::count_if(x.begin(), x.end(), [](double value) { return value != 0; });
  if (given > 0) {
    invalid(counter, "says that there is no entry, but x has " + std::to_string(x.size()) +
                         ", of which " + std::to_string(given) +
                         " are not 0: the pointers or the count are missing");
  }
}

Matrix symmetric_of_triangle(const Matrix& a, const std::string& where) {
  validate_places(a, where);
  if (a.rows != a.cols) {
    invalid(where, "is said to be a packed symmetric matrix, but has " + std::to_string(a.rows) +
                       " rows and " + std::to_string(a.cols) + " columns");
  }
  Matrix whole{.storage = Storage::triplet, .rows = a.rows, .cols = a.cols, .info = a.info};
  bool below = false;
  bool above = false;
  for_each_entry(a, [&](Index row, Index col, double value) {
    if (value == 0 && a.storage == Storage::dense) return;
    const auto put = [&](Index i, Index p) {
      whole.i.push_back(i);
      whole.p.push_back(p);
      whole.x.push_back(value);
    };
    put(row, col);
    if (row == col) return;
    put(col, row);
    if (value != 0) (row > col ? below : above) = true;
  });
  if (below && above) {
    invalid(where, "is said to be one triangle of a symmetric matrix, but has entries in both");
  }
  return a.storage == Storage::triplet ? whole : converted(whole, a.storage);
}

bool is_canonical(const Matrix& a) {
  if (a.storage == Storage::dense) return true;
  if (a.storage == Storage::triplet) return false;
  for (std::size_t major = 0; major + 1 < a.p.size(); ++major) {
    for (Index k = a.p[major] + 1; k < a.p[major + 1]; ++k) {
      if (a.i[k] <= a.i[k - 1]) return false;
    }
  }
  return true;
}

namespace {

/// Turns a canonical matrix by columns into one by rows, or the reverse.
Matrix turned(const Matrix& a) {
  const bool by_columns = a.storage == Storage::csc;
  const Index majors = by_columns ? a.cols : a.rows;
  const Index minors = by_columns ? a.rows : a.cols;
  Matrix result;
  result.storage = by_columns ? Storage::csr : Storage::csc;
  result.rows = a.rows;
  result.cols = a.cols;
  result.info = a.info;
  result.p.assign(static_cast<std::size_t>(minors) + 1, 0);
  result.i.resize(a.nnz());
  result.x.resize(a.nnz());
  for (const Index minor : a.i) ++result.p[static_cast<std::size_t>(minor) + 1];
  std::partial_sum(result.p.begin(), result.p.end(), result.p.begin());
  std::vector<Index> next(result.p.begin(), result.p.end() - 1);
  for (Index major = 0; major < majors; ++major) {
    for (Index k = a.p[major]; k < a.p[major + 1]; ++k) {
      const Index at = next[a.i[k]]++;
      result.i[at] = major;
      result.x[at] = a.x[k];
    }
  }
  return result;
}

}  // namespace

SparseColumns to_eigen(const Matrix& a) {
  SparseColumns result(a.rows, a.cols);
  if (a.storage == Storage::csc && is_canonical(a)) {
    result.resizeNonZeros(static_cast<Eigen::Index>(a.nnz()));
    std::copy(a.p.begin(), a.p.end(), result.outerIndexPtr());
    std::copy(a.i.begin(), a.i.end(), result.innerIndexPtr());
    std::copy(a.x.begin(), a.x.end(), result.valuePtr());
    return result;
  }
  if (a.storage == Storage::csr && is_canonical(a)) return to_eigen(turned(a));
  std::vector<Eigen::Triplet<double, Index>> entries;
  entries.reserve(a.nnz());
  for_each_entry(
      a, [&](Index row, Index col, double value) { entries.emplace_back(row, col, value); });
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

Matrix Matrix::from_eigen(const SparseColumns& a) {
  if (!a.isCompressed()) {
    SparseColumns compressed = a;
    compressed.makeCompressed();
    return from_eigen(compressed);
  }
  Matrix result;
  result.storage = Storage::csc;
  result.rows = static_cast<Index>(a.rows());
  result.cols = static_cast<Index>(a.cols());
  result.p.assign(a.outerIndexPtr(), a.outerIndexPtr() + a.cols() + 1);
  result.i.assign(a.innerIndexPtr(), a.innerIndexPtr() + a.nonZeros());
  result.x.assign(a.valuePtr(), a.valuePtr() + a.nonZeros());
  return result;
}

Matrix converted(const Matrix& a, Storage storage) {
  if (a.storage == storage) return a;
  const auto compressed = [](Storage one) { return one == Storage::csc || one == Storage::csr; };
  if (compressed(a.storage) && compressed(storage) && is_canonical(a)) return turned(a);
  Matrix result;
  switch (storage) {
    case Storage::csc:
      result = Matrix::from_eigen(to_eigen(a));
      break;
    case Storage::csr: {
      result = Matrix::from_eigen(to_eigen(a).transpose());
      result.storage = Storage::csr;
      std::swap(result.rows, result.cols);
      break;
    }
    case Storage::triplet: {
      result.rows = a.rows;
      result.cols = a.cols;
      result.i.reserve(a.nnz());
      result.p.reserve(a.nnz());
      result.x.reserve(a.nnz());
      for_each_entry(a, [&](Index row, Index col, double value) {
        result.i.push_back(row);
        result.p.push_back(col);
        result.x.push_back(value);
      });
      break;
    }
    case Storage::dense: {
      result.rows = a.rows;
      result.cols = a.cols;
      result.x.assign(static_cast<std::size_t>(a.rows) * static_cast<std::size_t>(a.cols), 0.0);
      for_each_entry(a, [&](Index row, Index col, double value) {
        result.x[static_cast<std::size_t>(col) * static_cast<std::size_t>(a.rows) +
                 static_cast<std::size_t>(row)] += value;
      });
      break;
    }
  }
  result.storage = storage;
  result.info = a.info;
  return result;
}

}  // namespace fclib
