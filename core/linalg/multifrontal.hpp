// Direct solution of sparse systems A x = b with a symmetric pattern and any values: the systems of
// Newton and interior-point methods, factorised again and again with one pattern.
//
// Multifrontal LU on the fronts of linalg/fronts.hpp, with dense kernels by Eigen. Rows are
// exchanged only inside the pivot block of a front, so that the pattern is fixed. A pivot that
// vanishes is replaced by a small one; the iterative refinement of the caller corrects that. A
// small system is one front: a dense LU.
//
// Threads take subtrees of fronts, then parts of the products in the fronts above. In solves they
// take only the subtrees. What a front adds to its parent is kept until the parent takes it, child
// by child. So the result is the same to the last bit for any number of threads.
#pragma once

#include <Eigen/Dense>
#include <memory>
#include <vector>

#include "deadline.hpp"
#include "linalg/dense_kernels.hpp"
#include "linalg/fronts.hpp"
#include "linalg/workers.hpp"

namespace fclib {

class Multifrontal {
 public:
  Multifrontal() = default;
  /// The symbolic factorisation alone. If this thread had a system with the same pattern shortly
  /// before, it is the one made then.
  explicit Multifrontal(const BlockPattern& pattern, int threads = 1);
  explicit Multifrontal(std::shared_ptr<const Fronts> symbolic, int threads = 1);

  /// Multiplications of one factorisation, and numbers that it keeps.
  [[nodiscard]] double flops() const { return symbolic_->flops; }
  [[nodiscard]] double memory() const { return symbolic_->memory; }
  /// [bytes] About what a factorisation takes at most, besides its values: the last fronts at work
  /// are three matrices of the size of the largest.
  [[nodiscard]] double bytes() const {
    const double largest = symbolic_->largest;
    return sizeof(double) * (symbolic_->memory + 3 * largest * largest);
  }
  [[nodiscard]] Index size() const { return symbolic_->size; }

  /// Factorises the matrix with these values (BlockPattern::values() of them). Returns false if an
  /// entry is not finite, or the deadline passes meanwhile.
  bool factorise(const std::vector<double>& values, const Deadline* deadline = nullptr);

  /// The threads that share its work, or none if it is too small for them.
  [[nodiscard]] Workers* workers() const { return workers_.get(); }
  /// CPU time of other threads than the caller's [s].
  [[nodiscard]] double others_cpu() const { return workers_ ? workers_->cpu_s() : 0; }

  /// The sign of the determinant of the last factorised matrix: 1 or -1.
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
    mutable Vector right;          // what a solve leaves to the parent
  };

  struct Task {  // a factorisation
    const std::vector<double>& values;
    double tiny;
    const Deadline* deadline;

    [[nodiscard]] bool out_of_time() const { return deadline != nullptr && deadline->passed(); }
  };

  bool factorise_pivots(Eigen::Ref<Dense> a, std::vector<Index>& exchanged, const Task& task,
                        int threads);
  bool factorise_front(std::size_t f, const Task& task, Dense& work, int threads);
  void share_out(int threads);
  void forward(std::size_t f, Vector& local) const;
  void backward(std::size_t f, Vector& local) const;
  template <class F>
  void split(Index n, int threads, const F& f);

  const DenseKernels* kernels_ = &dense_kernels();
  std::shared_ptr<const Fronts> symbolic_ = std::make_shared<Fronts>();
  std::vector<Factors> factors_;
  std::unique_ptr<Workers> workers_;              // if there are several
  std::vector<std::vector<std::size_t>> shares_;  // fronts of each thread, children first
  std::vector<std::size_t> top_;                  // fronts above them; all threads work on each
  std::vector<Dense> work_;                       // of each thread
  mutable Vector permuted_;
  mutable std::vector<Vector> local_;  // of each thread
};

}  // namespace fclib
