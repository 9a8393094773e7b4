// The data of one step of Moreau and Jean's scheme, from the equations of motion.
//
//   M (v' - v) = h F + H r + G lambda,   u = H^T v' + w,   G^T v' + b = 0
//
// with the matrix M + h theta C + h^2 theta^2 K for M, and f = (M + h theta C) v + h F
// - h^2 theta (1 - theta) K v. Dry friction adds for each joint an auxiliary degree of freedom and
// a contact; velocities that are given leave the unknowns; bodies that nothing links to a contact
// are left out. python/fclib/simulate/moreau_jean.py has the whole scheme.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "problems/global.hpp"
#include "stepping/columns.hpp"

namespace fclib::stepping {

/// Dry friction in k joints.
struct DryFriction {
  Columns gradient;               ///< (n x k) velocities of the joints; no column is empty
  std::span<const double> bound;  ///< (k) [N], [N m]
  std::span<const double> mass;   ///< (k) of the auxiliary degrees of freedom
};

/// Degrees of freedom whose velocity after the step is given.
struct Driven {
  std::span<const std::int64_t> dof;
  std::span<const double> velocity;
};

struct System {
  int d = 3;     ///< components of a contact
  double h = 0;  ///< step [s]
  double theta = 1;
  Columns M, C, K;                                      ///< (n x n)
  Columns H;                                            ///< (n x d nc)
  Columns G;                                            ///< (n x p)
  std::span<const double> force, v;                     ///< (n)
  std::span<const double> b;                            ///< (p)
  std::span<const double> w;                            ///< normal parts of the active contacts
  std::optional<std::span<const std::int64_t>> active;  ///< of the nc; all if there is none
  std::span<const std::int64_t> tree;                   ///< (n) of bodies
  std::optional<DryFriction> dry;
  std::optional<Driven> driven;
  bool all_bodies = false;  ///< also bodies that nothing touches
};

/// Matrices and vectors of a global problem.
struct Equations {
  Matrix M, H, G;
  std::vector<double> f, w, b;
  /// (n') degrees of freedom of the system, without auxiliary ones; nothing: all
  std::optional<std::vector<std::int64_t>> dofs;
};

struct Step {
  Equations problem;
  std::optional<Equations> rest;  ///< what moves freely, without contacts
  /// the active contacts that the problem has, if it has not all of them; those of dry friction
  /// come after the others
  std::optional<std::vector<std::int64_t>> touching;
};

Step step_of(const System& system);

}  // namespace fclib::stepping
