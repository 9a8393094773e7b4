// What all friction cones share: the natural map and the distances from a cone and its dual.
//
// A cone K offers, for a contact of dim components with the normal one first,
//
//   Vec project(const Vec& x) const;    the Euclidean projection on K; x itself where x is in K
//   Vec outside(const Vec& x) const;    x - P_K(x), which may be small beside x
//   Vec modified(const Vec& u) const;   u^, the modified velocity of de Saxce & Feng (1998)
//
// and is made from the coefficients of a contact, Cone(friction, contact).
#pragma once

#include <Eigen/Core>

#include "friction.hpp"

namespace fclib {

template <int D, class Real = double>
using ContactVector = Eigen::Matrix<Real, D, 1>;
template <int D>
using ContactMatrix = Eigen::Matrix<double, D, D>;

/// r - P_K(r - rho u^): zero exactly where the friction law holds between u and r.
///
/// Computed as rho u^ + (y - P_K(y)), y = r - rho u^, so that a large reaction does not swallow a
/// velocity that is wrong, nor a large normal part one at which a small limit of rolling binds.
///
/// Acary, Bremond, Huber, "On solving contact problems with Coulomb friction: formulations and
/// numerical comparisons" (2018), the natural map of section 3.
template <class Cone>
typename Cone::Vec natural_map(const Cone& cone, const typename Cone::Vec& u,
                               const typename Cone::Vec& r, typename Cone::Vec::Scalar rho = 1) {
  using Vec = typename Cone::Vec;
  const Vec velocity = rho * cone.modified(u);
  const Vec y = r - velocity;
  const Vec outside = cone.outside(y);
  if (outside == y) return r;
  return velocity + outside;
}

/// The distance of x from K.
template <class Cone>
typename Cone::Vec::Scalar cone_violation(const Cone& cone, const typename Cone::Vec& x) {
  return cone.outside(x).norm();
}

/// The distance of y from the dual cone K*, which by Moreau's decomposition is the norm of the
/// projection of -y on K.
template <class Cone>
typename Cone::Vec::Scalar dual_violation(const Cone& cone, const typename Cone::Vec& y) {
  return cone.project(-y).norm();
}

enum class ContactStatus { open, stick, slide };

/// Read off the set that the natural map projects on: no reaction, inside K, or on its boundary.
template <class Cone>
ContactStatus status_of(const Cone& cone, const typename Cone::Vec& u, const typename Cone::Vec& r,
                        typename Cone::Vec::Scalar rho) {
  const typename Cone::Vec y = r - rho * cone.modified(u);
  const typename Cone::Vec projection = cone.project(y);
  if (projection[0] == 0) return ContactStatus::open;
  return projection == y ? ContactStatus::stick : ContactStatus::slide;
}

}  // namespace fclib
