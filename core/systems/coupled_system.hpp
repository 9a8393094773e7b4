// The one linear system that Newton and interior-point methods solve here:
//
//   (B + D W) x = h,   D and B block-diagonal, d x d, possibly singular or not symmetric.
//
// B is the identity unless the caller asks for another. On the contacts, the system is factorised
// as it stands, with each block row scaled. If B is the identity and the problem is known by its
// bodies, W = H^T M^-1 H, the same x comes from
//
//   (M + H D H^T) y = H h,   x = h - D H^T y
//
// Whichever takes fewer operations is factorised. One step of iterative refinement with W follows.
#pragma once

#include <memory>

#include "linalg/multifrontal.hpp"
#include "reduced/reduced_problem.hpp"
#include "systems/body_matrix.hpp"

namespace fclib {

class CoupledSystem {
 public:
  enum class Form { identity, general };  ///< of B

  /// Whether the bodies have at most half as many coordinates as the contacts. If so, the symbolic
  /// factorisation on the contacts is not needed.
  [[nodiscard]] static bool bodies_are_fewer(const ReducedProblem& problem) {
    return problem.primal != nullptr && 2 * problem.primal->M.rows() <= problem.m();
  }

  /// Makes the symbolic factorisations; keeps a reference to the problem.
  explicit CoupledSystem(const ReducedProblem& problem, Form form = Form::identity,
                         int threads = 1);

  /// The blocks of D, each d x d by columns, one after another (d d nc). The caller fills them
  /// before factorise().
  [[nodiscard]] std::vector<double>& blocks() { return D_; }

  /// The blocks of B if it is general, in the same form; zero at first.
  [[nodiscard]] std::vector<double>& own_blocks() { return B_; }

  /// Returns false if the blocks are not finite, or if the time is over.
  bool factorise();

  /// x <- (B + D W)^-1 x. An iteration that corrects itself needs no refinement.
  void solve(Vector& x, bool refined = true);

  /// The sign of det(B + D W), 1 or -1, after factorise().
  [[nodiscard]] int determinant_sign() const { return lu_.determinant_sign(); }

  [[nodiscard]] std::int64_t factorisations() const { return factorisations_; }
  /// Multiplications of one factorisation.
  [[nodiscard]] double flops() const { return lu_.flops(); }
  /// [bytes] About what a factorisation takes, known before it is made.
  [[nodiscard]] double bytes() const { return lu_.bytes(); }
  [[nodiscard]] bool on_bodies() const { return on_bodies_; }
  /// Threads that may share loops over the contacts too. None if the system is small.
  [[nodiscard]] Workers* workers() const { return lu_.workers(); }
  /// CPU time of other threads than the caller's [s].
  [[nodiscard]] double others_cpu() const { return lu_.others_cpu(); }

 private:
  template <int D>
  void fill_contacts();
  void apply(const std::vector<double>& blocks, const Vector& x, Vector& y) const;
  void solve_once(Vector& x);
  // the symbolic factorisations; false if the bodies cannot be used
  void analyse_contacts();
  template <int D>
  void analyse_contacts_of();
  bool analyse_bodies();

  const ReducedProblem& problem_;
  int threads_;
  Multifrontal lu_;
  std::vector<double> D_;
  std::vector<double> B_;  // empty: the identity
  std::vector<double> values_;
  Vector row_scale_;                    // of each contact
  std::vector<std::int64_t> place_;     // of each block of W in the values, in W's order
  std::vector<std::int64_t> diagonal_;  // of each diagonal block
  bool on_bodies_ = false;
  BodyMatrix bodies_;  // used if the system is factorised on them
  std::int64_t factorisations_ = 0;
  Vector rhs_, residual_, product_, body_;
  Vector zero_;
};

}  // namespace fclib
