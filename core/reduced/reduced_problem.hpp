// The problem in the form that solvers take: u = W r + q and the friction law of each contact.
#pragma once

#include <functional>

#include "deadline.hpp"
#include "friction.hpp"
#include "linalg/block_matrix.hpp"

namespace fclib {

/// The factors of W = H^T M^-1 H, for solvers that work on the bodies where that is cheaper.
struct Primal {
  SparseColumns M;  ///< (n x n)
  SparseColumns H;  ///< (n x m)
};

/// W (m x m) by blocks, q (m), friction (nc).
struct ReducedProblem {
  BlockMatrix W;
  Vector q;
  Friction friction;
  double scale = 1;  ///< errors are relative to this: ||q||, before bilateral constraints left it
  Vector rho;        ///< of the scaled natural map (nc); empty: errors are by the plain one alone
  double scaled_scale = 1;  ///< errors by the scaled map are relative to this: ||rho q||
  /// Where u is known better than W r + q rounds, if anywhere: with reactions that are large beside
  /// q, what W adds to it from there rounds less (m each).
  Vector known_r, known_u;
  const Primal* primal = nullptr;      ///< where the problem is known by its bodies
  const Deadline* deadline = nullptr;  ///< of the solve, if it has one
  /// Whether something near y (nc) proves that the problem as it was given has no solution: what
  /// solvers find here may be the rounding of conversions. Without it nothing is proven.
  const std::function<bool(const Vector& y)>* proves_no_solution = nullptr;

  [[nodiscard]] int d() const { return W.block_size(); }
  [[nodiscard]] Index nc() const { return W.block_count(); }
  [[nodiscard]] Eigen::Index m() const { return q.size(); }
  [[nodiscard]] bool rolling() const { return friction.mu_r.size() > 0; }

  /// No more factorisations then: they fail.
  [[nodiscard]] bool out_of_time() const { return deadline != nullptr && deadline->passed(); }

  /// u = W r + q.
  void velocity(const Vector& r, Vector& u, Workers* workers = nullptr) const {
    if (known_r.size() == 0) {
      W.multiply_add(r, q, u, workers);
    } else {
      W.multiply_add(r - known_r, known_u, u, workers);
    }
  }
};

}  // namespace fclib
