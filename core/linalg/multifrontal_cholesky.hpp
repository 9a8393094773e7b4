// Cholesky factorisation of a large sparse matrix, symmetric positive definite, on the fronts of
// linalg/fronts.hpp with dense kernels by Eigen. It is for mass and stiffness matrices of meshes:
// their factors are so dense that an algorithm entry by entry takes ten times as long.
#pragma once

#include <Eigen/Dense>
#include <optional>
#include <vector>

#include "deadline.hpp"
#include "linalg/fronts.hpp"

namespace fclib {

class MultifrontalCholesky {
 public:
  /// `symbolic` must be made from symmetric_pattern(a).
  MultifrontalCholesky(Fronts symbolic, const SparseColumns& a);

  /// The pattern of a symmetric matrix, 1 x 1 blocks.
  static BlockPattern symmetric_pattern(const SparseColumns& a);

  /// Whether the matrix is positive definite; if not, there are no factors.
  [[nodiscard]] bool positive_definite() const { return positive_definite_; }

  /// A^-1 b.
  [[nodiscard]] Vector solve(ConstVectorRef b) const;

  /// |L| |L^T x|.
  [[nodiscard]] Vector terms(ConstVectorRef x) const;

  /// B^T A^-1 B, symmetric to the last bit, or nothing if the deadline passes meanwhile.
  [[nodiscard]] std::optional<SparseColumns> gram(const SparseColumns& b,
                                                  const Deadline& deadline) const;
  /// Its diagonal.
  [[nodiscard]] Vector gram_diagonal(const SparseColumns& b) const;

 private:
  using Dense = Eigen::MatrixXd;

  struct Factors {   // of one front
    Dense diagonal;  // L11
    Dense lower;     // L21
  };

  bool factorise(const SparseColumns& a);
  std::vector<Index> roots() const;
  template <class Visit>
  bool forward(const SparseColumns& b, const Deadline& deadline, const Visit& visit) const;

  Fronts symbolic_;
  std::vector<Factors> factors_;
  bool positive_definite_ = false;
};

}  // namespace fclib
