// Solves with the matrices of a problem: M (n x n) and R (p x p), factorised once.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "deadline.hpp"
#include "linalg/matrix.hpp"
#include "linalg/multifrontal_cholesky.hpp"

namespace fclib {

/// A sparse factorisation: Cholesky if the matrix is symmetric (by supernodes if that is faster),
/// else LU, by dense blocks if the matrix has such blocks.
///
/// Files hold mass matrices that are not quite symmetric because of rounding or a linearisation
/// (1e-7 relative in CubeH8). Half of such a matrix would be another problem.
class Factorization {
 public:
  /// Throws Error (unsuitable) if the matrix is singular, or symmetric but not positive definite.
  /// The message calls it `name`. With `definite` false a symmetric indefinite matrix is accepted
  /// too.
  Factorization(const SparseColumns& a, const std::string& name, bool definite = true);
  Factorization(Factorization&& other) noexcept;
  Factorization& operator=(Factorization&& other) noexcept;
  ~Factorization();

  /// A^-1 b.
  [[nodiscard]] Vector solve(ConstVectorRef b) const;
  /// A^-1 B.
  [[nodiscard]] SparseColumns solve(const SparseColumns& b) const;

  /// |L| |L^T x| for A = L L^T: the sizes of the terms that the factors add up from x to A x, and
  /// so the rounding of A^-1. It is 0 if A is factorised as L U.
  [[nodiscard]] Vector terms(ConstVectorRef x) const;

  /// B^T A^-1 B, symmetric to the last bit if A is. Nothing if `deadline` passes meanwhile.
  [[nodiscard]] std::optional<SparseColumns> gram(const SparseColumns& b,
                                                  const Deadline& deadline) const;
  [[nodiscard]] SparseColumns gram(const SparseColumns& b) const;
  /// Its diagonal.
  [[nodiscard]] Vector gram_diagonal(const SparseColumns& b) const;

  /// Y with B^T A^-1 C = Y^T half(C) for any C, if A is factorised so.
  [[nodiscard]] std::optional<SparseColumns> half(const SparseColumns& b) const;

 private:
  // Eigen's; only the .cpp file sees it
  struct Cholesky;
  struct LU;
  class Blocks;

  /// Y = L^-1 P B, so that B^T A^-1 B = Y^T Y, from the simplicial factors. The cost is that of the
  /// non-zeros it makes, not n times the columns: bodies that do not touch stay separate.
  [[nodiscard]] std::optional<SparseColumns> half_solve(const SparseColumns& b,
                                                        const Deadline& deadline) const;

  std::unique_ptr<Cholesky> cholesky_;                // for bodies, each with its own small block
  std::unique_ptr<MultifrontalCholesky> supernodal_;  // for meshes
  std::unique_ptr<Blocks> blocks_;                    // for bodies, if A is not symmetric
  std::unique_ptr<LU> lu_;
};

}  // namespace fclib
