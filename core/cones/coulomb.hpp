// The Coulomb cone K = { ||r_T|| <= mu r_N } of one contact, in d = 2 or 3 dimensions.
#pragma once

#include <Eigen/Core>
#include <algorithm>

namespace fclib {

template <int D>
using ContactVector = Eigen::Matrix<double, D, 1>;
template <int D>
using ContactMatrix = Eigen::Matrix<double, D, D>;

template <int D>
double tangential_norm(const ContactVector<D>& x) {
  if constexpr (D == 2) {
    return std::abs(x[1]);
  } else {
    return x.template tail<D - 1>().norm();
  }
}

/// u^ = u + [mu ||u_T||, 0, 0], the modified velocity (de Saxce & Feng 1998).
template <int D>
ContactVector<D> modified_velocity(const ContactVector<D>& u, double mu) {
  ContactVector<D> result = u;
  result[0] += mu * tangential_norm<D>(u);
  return result;
}

/// The Euclidean projection on K.
template <int D>
ContactVector<D> project_on_cone(const ContactVector<D>& x, double mu) {
  const double norm = tangential_norm<D>(x);
  if (norm <= mu * x[0]) return x;
  if (mu * norm <= -x[0]) return ContactVector<D>::Zero();
  ContactVector<D> result;
  result[0] = (x[0] + mu * norm) / (1.0 + mu * mu);
  const double scale = norm > 0 ? mu * result[0] / norm : 0.0;
  result.template tail<D - 1>() = scale * x.template tail<D - 1>();
  return result;
}

/// r - P_K(r - rho u^): zero exactly where Coulomb's law holds between u and r.
///
/// Acary, Bremond, Huber, "On solving contact problems with Coulomb friction: formulations and
/// numerical comparisons" (2018), the natural map of section 3.
template <int D>
ContactVector<D> natural_map(const ContactVector<D>& u, const ContactVector<D>& r, double mu,
                             double rho = 1.0) {
  return r - project_on_cone<D>(r - rho * modified_velocity<D>(u, mu), mu);
}

/// The distance of x from K.
template <int D>
double cone_violation(const ContactVector<D>& x, double mu) {
  return (x - project_on_cone<D>(x, mu)).norm();
}

/// The distance of y from the dual cone K* = { y_N >= mu ||y_T|| }, which by Moreau's decomposition
/// is the norm of the projection of -y on K.
template <int D>
double dual_violation(const ContactVector<D>& y, double mu) {
  return project_on_cone<D>(-y, mu).norm();
}

}  // namespace fclib
