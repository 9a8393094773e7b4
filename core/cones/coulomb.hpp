// The Coulomb cone K = { ||r_T|| <= mu r_N } of one contact, in d = 2 or 3 dimensions.
#pragma once

#include <Eigen/Core>
#include <algorithm>

namespace fclib {

template <int D, class Real = double>
using ContactVector = Eigen::Matrix<Real, D, 1>;
template <int D>
using ContactMatrix = Eigen::Matrix<double, D, D>;

template <int D, class Real>
Real tangential_norm(const ContactVector<D, Real>& x) {
  if constexpr (D == 2) {
    return std::abs(x[1]);
  } else {
    return x.template tail<D - 1>().norm();
  }
}

/// u^ = u + [mu ||u_T||, 0, 0], the modified velocity (de Saxce & Feng 1998).
template <int D, class Real>
ContactVector<D, Real> modified_velocity(const ContactVector<D, Real>& u, Real mu) {
  ContactVector<D, Real> result = u;
  result[0] += mu * tangential_norm<D>(u);
  return result;
}

/// The Euclidean projection on K.
template <int D, class Real>
ContactVector<D, Real> project_on_cone(const ContactVector<D, Real>& x, Real mu) {
  const Real norm = tangential_norm<D>(x);
  if (norm <= mu * x[0]) return x;
  if (mu * norm <= -x[0]) return ContactVector<D, Real>::Zero();
  ContactVector<D, Real> result;
  result[0] = (x[0] + mu * norm) / (1 + mu * mu);
  const Real scale = norm > 0 ? mu * result[0] / norm : Real(0);
  result.template tail<D - 1>() = scale * x.template tail<D - 1>();
  return result;
}

/// r - P_K(r - rho u^): zero exactly where Coulomb's law holds between u and r.
///
/// Computed as rho u^ + (y - P_K(y)), y = r - rho u^, so that a large reaction does not swallow a
/// velocity that is wrong.
///
/// Acary, Bremond, Huber, "On solving contact problems with Coulomb friction: formulations and
/// numerical comparisons" (2018), the natural map of section 3.
template <int D, class Real>
ContactVector<D, Real> natural_map(const ContactVector<D, Real>& u, const ContactVector<D, Real>& r,
                                   Real mu, Real rho = 1) {
  const ContactVector<D, Real> velocity = rho * modified_velocity<D>(u, mu);
  const ContactVector<D, Real> y = r - velocity;
  const Real norm = tangential_norm<D>(y);
  if (norm <= mu * y[0]) return velocity;
  if (mu * norm <= -y[0]) return r;
  const Real outside = (norm - mu * y[0]) / (1 + mu * mu);
  ContactVector<D, Real> result = velocity;
  result[0] -= mu * outside;
  result.template tail<D - 1>() += (outside / norm) * y.template tail<D - 1>();
  return result;
}

/// The distance of x from K.
template <int D, class Real>
Real cone_violation(const ContactVector<D, Real>& x, Real mu) {
  return (x - project_on_cone<D>(x, mu)).norm();
}

/// The distance of y from the dual cone K* = { y_N >= mu ||y_T|| }, which by Moreau's decomposition
/// is the norm of the projection of -y on K.
template <int D, class Real>
Real dual_violation(const ContactVector<D, Real>& y, Real mu) {
  const ContactVector<D, Real> opposite = -y;
  return project_on_cone<D>(opposite, mu).norm();
}

}  // namespace fclib
