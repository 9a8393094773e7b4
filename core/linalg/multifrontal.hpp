// Direct solution of sparse systems A x = b whose pattern is symmetric and whose values need not
// be: the systems of Newton and interior-point methods, factorised again and again on one pattern.
//
// Multifrontal LU on the fronts of linalg/fronts.hpp, dense kernels by Eigen. Rows are exchanged
// inside the pivot block of a front only, so that the pattern is fixed; pivots that vanish are
// replaced by a small one, which iterative refinement by the caller makes good. A small system is
// one front: a dense LU.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "linalg/fronts.hpp"

namespace fclib {

class Multifrontal {
 public:
  Multifrontal() = default;
  /// Orders and plans; nothing numeric. The pattern is not kept.
  explicit Multifrontal(const BlockPattern& pattern);

  /// Multiplications of one factorisation, and numbers that it keeps.
  [[nodiscard]] double flops() const { return plan_.flops; }
  [[nodiscard]] double memory() const { return plan_.memory; }
  [[nodiscard]] Index size() const { return plan_.size; }

  /// Factorises the matrix with these values (BlockPattern::values() of them). False where an entry
  /// is not finite.
  bool factorise(const std::vector<double>& values);

  /// Of the determinant of the matrix factorised last: 1 or -1.
  [[nodiscard]] int determinant_sign() const;

  /// b <- A^-1 b, b of length size().
  void solve(Vector& b) const;

 private:
  using Dense = Eigen::MatrixXd;

  struct Factors {                 // of one front
    Dense diagonal;                // L11 \ U11
    Dense lower, upper;            // L21, U12
    std::vector<Index> exchanged;  // rows, as in LAPACK
    Dense update;                  // until the parent has taken it
  };

  static bool factorise_pivots(Eigen::Ref<Dense> a, std::vector<Index>& exchanged, double tiny);

  Fronts plan_;
  std::vector<Factors> factors_;
  Dense work_;
  mutable Vector permuted_;
  mutable Vector local_;
};

}  // namespace fclib
