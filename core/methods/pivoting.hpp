// Lemke's method. If each disk of tangential reactions is replaced by a polygon, Coulomb's law is a
// linear complementarity problem (Stewart & Trinkle 1996, "An implicit time-stepping scheme for
// rigid body dynamics with inelastic collisions and Coulomb friction"; Anitescu & Potra 1997). In
// the plane, also with rolling, it is the law itself. Reactions are
//   r = B x,   x >= 0,   B the normals and the edges of the polygons
//
// and with the slip velocities lambda of each polygon
//
//   0 <= x_N     _|_  u_N                                >= 0
//   0 <= x_T     _|_  B_T^T u + lambda                   >= 0
//   0 <= lambda  _|_  mu x_N - sum of the polygon's x_T  >= 0
//
// Its matrix is copositive. If Slater's condition holds, Lemke's method ends at a solution (Cottle,
// Pang & Stone 1992, theorem 4.4.12). If not, it may end at a ray, and with another covering vector
// at a solution. The matrix is dense, so this is for few contacts.
#pragma once

#include "contact/cones.hpp"
#include "function_ref.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

template <class Cone>
class Pivoting {
 public:
  static constexpr int D = Cone::dim;

  /// Uses polygons with this many edges.
  Pivoting(const ReducedProblem& problem, int edges);

  /// The number of unknowns of the complementarity problem.
  [[nodiscard]] Eigen::Index size() const { return M_.rows(); }

  /// [bytes] What the two dense matrices of such a problem take.
  static double bytes(const ReducedProblem& problem, int edges);

  /// Runs Lemke's method from a covering vector (size, positive), at most `most` pivots. r (m)
  /// becomes its end: a solution or a point of a ray. Returns the number of pivots. `stop` is asked
  /// between pivots and gets the number of those made; if it returns true, r is zero.
  int solve(const Vector& cover, int most, FunctionRef<bool(int pivots)> stop, Vector& r) const;

 private:
  const ReducedProblem& problem_;
  /// (m x 1 + corners of a contact) The rows of B of each contact, without its zeros: the normal,
  /// then the edges; scaled by contacts.
  Eigen::MatrixXd edges_;
  Eigen::MatrixXd M_;
  Vector Q_;
};

#define FCLIB_DECLARE(Cone) extern template class Pivoting<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
