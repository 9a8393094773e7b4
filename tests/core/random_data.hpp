// Random matrices and vectors for tests, the same on every platform.
#pragma once

#include <Eigen/LU>
#include <cstdint>
#include <random>

#include "linalg/matrix.hpp"

namespace fclib::testing {

class RandomData {
 public:
  explicit RandomData(std::uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1.0p-53);
  }

  Vector vector(Eigen::Index size) {
    Vector result(size);
    for (auto& value : result) value = uniform(-1, 1);
    return result;
  }

  Eigen::MatrixXd dense(Eigen::Index rows, Eigen::Index cols) {
    Eigen::MatrixXd result(rows, cols);
    for (auto& value : result.reshaped()) value = uniform(-1, 1);
    return result;
  }

  /// Each entry is there with probability `share`.
  SparseColumns sparse(Eigen::Index rows, Eigen::Index cols, double share) {
    Eigen::MatrixXd values = dense(rows, cols);
    for (auto& value : values.reshaped()) {
      if (uniform(0, 1) > share) value = 0;
    }
    return values.sparseView();
  }

  /// B B^T + I.
  SparseColumns definite(Eigen::Index size, double share) {
    const SparseColumns b = sparse(size, size, share);
    SparseColumns identity(size, size);
    identity.setIdentity();
    return SparseColumns(b * SparseColumns(b.transpose())) + identity;
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace fclib::testing
