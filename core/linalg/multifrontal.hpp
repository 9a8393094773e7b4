// Direct solution of sparse systems A x = b whose pattern is symmetric and whose values need not
// be: the systems of Newton and interior-point methods, factorised again and again on one pattern.
//
// Multifrontal LU (Duff & Reid, "The multifrontal solution of indefinite sparse symmetric linear
// systems", 1983): an approximate minimum degree ordering of the blocks, supernodes with relaxed
// amalgamation, dense kernels by Eigen. Rows are exchanged inside the pivot block of a front only,
// so that the pattern is fixed; pivots that vanish are replaced by a small one, which iterative
// refinement by the caller makes good. A small system is one front: a dense LU.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <vector>

#include "linalg/matrix.hpp"

namespace fclib {

/// The symmetric pattern of a matrix of d x d blocks, by columns, with all diagonal blocks.
/// Block k of the pattern has its values in values[d*d*k ...], by columns.
struct BlockPattern {
  int d = 1;
  std::vector<std::int64_t> first;  // (nodes + 1)
  std::vector<Index> row;

  [[nodiscard]] Index nodes() const { return static_cast<Index>(first.size()) - 1; }
  [[nodiscard]] std::size_t values() const {
    return static_cast<std::size_t>(d) * static_cast<std::size_t>(d) * row.size();
  }
};

class Multifrontal {
 public:
  Multifrontal() = default;
  /// Orders and plans; nothing numeric. The pattern is not kept.
  explicit Multifrontal(const BlockPattern& pattern);

  /// Multiplications of one factorisation, and numbers that it keeps.
  [[nodiscard]] double flops() const { return flops_; }
  [[nodiscard]] double memory() const { return memory_; }
  [[nodiscard]] Index size() const { return size_; }

  /// Factorises the matrix with these values (BlockPattern::values() of them). False where an entry
  /// is not finite.
  bool factorise(const std::vector<double>& values);

  /// Of the determinant of the matrix factorised last: 1 or -1.
  [[nodiscard]] int determinant_sign() const;

  /// b <- A^-1 b, b of length size().
  void solve(Vector& b) const;

 private:
  using Dense = Eigen::MatrixXd;

  struct Entry {  // one block of A, and where it goes in its front
    std::int64_t block;
    Index row, col;  // scalar offsets
  };
  struct Front {
    Index pivots = 0;          // scalar
    Index size = 0;            // scalar: pivots and what they update
    std::vector<Index> nodes;  // pivot nodes first (new numbering)
    std::vector<Entry> entries;
    std::vector<Index> children;
    std::vector<Index> to_parent;  // scalar offset in the parent's front of each update block
    // the factors
    Dense diagonal;                // L11 \ U11
    Dense lower, upper;            // L21, U12
    std::vector<Index> exchanged;  // rows, as in LAPACK
    Dense update;                  // until the parent has taken it
  };

  static bool factorise_pivots(Eigen::Ref<Dense> a, std::vector<Index>& exchanged, double tiny);

  int d_ = 1;
  Index size_ = 0;
  double flops_ = 0;
  double memory_ = 0;
  std::vector<Index> position_;  // of each node in the new numbering
  std::vector<Front> fronts_;    // children before parents
  Dense work_;
  mutable Vector permuted_;
  mutable Vector local_;
};

}  // namespace fclib
