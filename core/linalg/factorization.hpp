// Solving with the matrices of a problem: M (n x n) and R (p x p), factorised once.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "deadline.hpp"
#include "linalg/matrix.hpp"
#include "linalg/multifrontal_cholesky.hpp"

namespace fclib {

/// A sparse factorisation: Cholesky where the matrix is symmetric, by supernodes where it is worth
/// it, and LU where it is not.
///
/// Files hold mass matrices whose symmetry is lost to rounding or to a linearisation (1e-7
/// relative in CubeH8); half of such a matrix would be another problem.
class Factorization {
 public:
  /// Throws Error (unsuitable) where the matrix is symmetric but not positive definite, or
  /// singular; `name` is what the message calls it. With `definite` false a symmetric indefinite
  /// matrix is accepted too.
  Factorization(const SparseColumns& a, const std::string& name, bool definite = true);
  Factorization(Factorization&& other) noexcept;
  Factorization& operator=(Factorization&& other) noexcept;
  ~Factorization();

  /// A^-1 b.
  [[nodiscard]] Vector solve(ConstVectorRef b) const;
  /// A^-1 B.
  [[nodiscard]] SparseColumns solve(const SparseColumns& b) const;

  /// |L| |L^T x| of A = L L^T: the sizes of what the factors add up on the way from x to A x, and
  /// so what rounding leaves of A^-1. 0 if A is factorised as L U.
  [[nodiscard]] Vector terms(ConstVectorRef x) const;

  /// B^T A^-1 B; symmetric to the last bit where A is. Nothing where `deadline` passes on the way.
  [[nodiscard]] std::optional<SparseColumns> gram(const SparseColumns& b,
                                                  const Deadline& deadline) const;
  [[nodiscard]] SparseColumns gram(const SparseColumns& b) const;
  /// Its diagonal.
  [[nodiscard]] Vector gram_diagonal(const SparseColumns& b) const;

  /// Y with B^T A^-1 C = Y^T half(C) for any C, where A is factorised so.
  [[nodiscard]] std::optional<SparseColumns> half(const SparseColumns& b) const;

 private:
  // Eigen's, which only the .cpp file sees
  struct Cholesky;
  struct LU;

  /// Y = L^-1 P B, so that B^T A^-1 B = Y^T Y, of the simplicial factors. Costs the non-zeros it
  /// makes, not n times the columns: bodies that do not touch stay apart.
  [[nodiscard]] std::optional<SparseColumns> half_solve(const SparseColumns& b,
                                                        const Deadline& deadline) const;

  std::unique_ptr<Cholesky> cholesky_;                // of bodies, each with its own small block
  std::unique_ptr<MultifrontalCholesky> supernodal_;  // of meshes
  std::unique_ptr<LU> lu_;
};

}  // namespace fclib
