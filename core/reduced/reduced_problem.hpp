// The problem in the form that solvers take: u = W r + q and the friction law of each contact.
#pragma once

#include <functional>

#include "deadline.hpp"
#include "friction.hpp"
#include "linalg/block_matrix.hpp"

namespace fclib {

/// The factors of W = H^T M^-1 H, for solvers that work on the bodies if that is cheaper.
struct Primal {
  SparseColumns M;  ///< (n x n)
  SparseColumns H;  ///< (n x m)
};

/// W (m x m) by blocks, q (m), friction (nc).
struct ReducedProblem {
  BlockMatrix W;
  Vector q;
  Friction friction;
  double scale = 1;  ///< errors are relative to ||q|| before bilateral constraints were eliminated
  Vector rho{};      ///< of the scaled natural map (nc); empty: errors use only the plain one
  double scaled_scale = 1;  ///< errors of the scaled map are relative to this: ||rho q||
  /// A point r at which u is known with less rounding than W r + q, if there is one. If reactions
  /// are large beside q, the change of u by W from that point rounds less (m each).
  Vector known_r{};
  Vector known_u{};
  const Primal* primal = nullptr;      ///< if the problem is known by its bodies
  const Deadline* deadline = nullptr;  ///< of the solve, if it has one
  /// Whether something near y (nc) proves that the problem as given has no solution: what solvers
  /// find here may be the rounding of conversions. Null: nothing is proven.
  const std::function<bool(const Vector& y)>* proves_no_solution = nullptr;

  [[nodiscard]] int d() const { return W.block_size(); }
  [[nodiscard]] Index nc() const { return W.block_count(); }
  [[nodiscard]] Eigen::Index m() const { return q.size(); }

  /// If this is true, factorisations fail: there is no time for them.
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
