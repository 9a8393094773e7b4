// What all friction cones share: the natural map and the distances from a cone and its dual.
//
// A cone K offers, for a contact of dim components with the normal one first,
//
//   Vec project(const Vec& x) const;    the Euclidean projection on K; x itself if x is in K
//   Vec modified(const Vec& u) const;   u^, the modified velocity of de Saxce & Feng (1998)
//   NaturalPoint<Vec> natural(const Vec& u, const Vec& r, Real rho, Slack slack) const;
//
// and is made from the coefficients of a contact, Cone(friction, contact).
#pragma once

#include <Eigen/Core>
#include <array>
#include <type_traits>
#include <utility>

#include "friction.hpp"

namespace fclib {

template <int D, class Real = double>
using ContactVector = Eigen::Matrix<Real, D, 1>;
template <int D>
using ContactMatrix = Eigen::Matrix<double, D, D>;

enum class ContactStatus { open, stick, slide };

/// F = r - P_K(r - rho u^), and which part of the projection it comes from: 0, the inside of K, or
/// its boundary.
template <class Vec>
struct NaturalPoint {
  Vec map;
  ContactStatus status;
};

/// Calls visit(g) for each group of tangential components, with g as a constant: Cone::start(g) is
/// its first component, and Cone::size(g) their number.
template <class Cone, class Visit>
void for_each_group(const Visit& visit) {
  [&]<int... g>(std::integer_sequence<int, g...>) {
    (visit(std::integral_constant<int, g>{}), ...);
  }(std::make_integer_sequence<int, Cone::groups>{});
}

/// A norm; 0 if it is no more than `slack`.
template <class Real>
Real above_slack(Real norm, Real slack) {
  return norm <= slack ? Real(0) : norm;
}

/// r - P_K(r - rho u^): zero exactly if the friction law holds between u and r.
///
/// The parts of u^ are not added up first: with mu = 1e10, u^_N = u_N + mu ||u_T|| would swallow
/// r_N and u_N, and their difference would have no correct digit. `slack` has one velocity for each
/// group of the cone. If ||u_g|| is not above it, it is rounding of the data and adds nothing to
/// u^_N.
///
/// Acary, Bremond, Huber, "On solving contact problems with Coulomb friction: formulations and
/// numerical comparisons" (2018), the natural map of section 3.
template <class Cone>
typename Cone::Vec natural_map(const Cone& cone, const typename Cone::Vec& u,
                               const typename Cone::Vec& r, typename Cone::Vec::Scalar rho = 1,
                               const typename Cone::Slack& slack = {}) {
  return cone.natural(u, r, rho, slack).map;
}

/// The distance of x from K. Without a velocity, the natural map is x - P_K(x).
template <class Cone>
typename Cone::Vec::Scalar cone_violation(const Cone& cone, const typename Cone::Vec& x) {
  using Vec = typename Cone::Vec;
  return natural_map(cone, Vec(Vec::Zero()), x).norm();
}

/// The distance of y from the dual cone K*. By Moreau's decomposition it is the norm of the
/// projection of -y on K.
template <class Cone>
typename Cone::Vec::Scalar dual_violation(const Cone& cone, const typename Cone::Vec& y) {
  return cone.project(-y).norm();
}

}  // namespace fclib
