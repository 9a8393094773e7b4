#include "linalg/matrix.hpp"

#include <algorithm>
#include <cmath>

#include "error.hpp"

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

}  // namespace

void validate(const Matrix& a, const std::string& where) {
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
  for (std::size_t k = 0; k < a.x.size(); ++k) {
    if (!std::isfinite(a.x[k])) {
      invalid(where + "/x[" + std::to_string(k) + "]", "the value is not a finite number");
    }
  }
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

SparseColumns to_eigen(const Matrix& a) {
  SparseColumns result(a.rows, a.cols);
  std::vector<Eigen::Triplet<double, Index>> entries;
  entries.reserve(a.nnz());
  for_each_entry(
      a, [&](Index row, Index col, double value) { entries.emplace_back(row, col, value); });
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

Matrix Matrix::from_eigen(const SparseColumns& a) {
  SparseColumns compressed = a;
  compressed.makeCompressed();
  Matrix result;
  result.storage = Storage::csc;
  result.rows = static_cast<Index>(a.rows());
  result.cols = static_cast<Index>(a.cols());
  result.p.assign(compressed.outerIndexPtr(), compressed.outerIndexPtr() + a.cols() + 1);
  result.i.assign(compressed.innerIndexPtr(), compressed.innerIndexPtr() + compressed.nonZeros());
  result.x.assign(compressed.valuePtr(), compressed.valuePtr() + compressed.nonZeros());
  return result;
}

Matrix converted(const Matrix& a, Storage storage) {
  if (a.storage == storage) return a;
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
