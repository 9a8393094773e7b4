// Lemke's method on the linear complementarity problem that Coulomb's law is where each disk of
// tangential reactions is a polygon (Stewart & Trinkle 1996, "An implicit time-stepping scheme for
// rigid body dynamics with inelastic collisions and Coulomb friction"; Anitescu & Potra 1997). In
// the plane, and with rolling in the plane, it is the law itself. Reactions are
//
//   r = B x,   x >= 0,   B the normals and the edges of the polygons
//
// and with the slip velocities lambda of each polygon
//
//   0 <= x_N     _|_  u_N                                >= 0
//   0 <= x_T     _|_  B_T^T u + lambda                   >= 0
//   0 <= lambda  _|_  mu x_N - sum of the polygon's x_T  >= 0
//
// Its matrix is copositive: Lemke's method ends at a solution wherever Slater's condition holds
// (Cottle, Pang & Stone 1992, theorem 4.4.12). Elsewhere it may end at a ray, and with another
// covering vector at a solution. Dense: for few contacts.
#pragma once

#include "contact/cones.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

template <class Cone>
class Pivoting {
 public:
  static constexpr int D = Cone::dim;

  /// Polygons of this many edges.
  Pivoting(const ReducedProblem& problem, int edges);

  /// Unknowns of the complementarity problem.
  [[nodiscard]] Eigen::Index size() const { return M_.rows(); }

  /// Reactions (m) where Lemke's method from a covering vector (size, positive) ends, at a solution
  /// or at a ray. Pivots made; it goes no further than `most` of them.
  int solve(const Vector& cover, int most, Vector& r) const;

 private:
  const ReducedProblem& problem_;
  Eigen::MatrixXd B_;  // (m x x), scaled by contacts
  Eigen::MatrixXd M_;
  Vector Q_;
};

#define FCLIB_DECLARE(Cone) extern template class Pivoting<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
