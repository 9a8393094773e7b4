// The map of Alart & Curnier, "A mixed formulation for frictional contact problems prone to Newton
// like solution methods" (1991): z_N is clipped at zero, and each tangential group of z (sliding,
// and rolling where there is any) is projected on the disk of radius mu max(z_N, 0). Its fixed
// points r = map(r - rho u) are the solutions of the contact law, for any rho > 0.
#pragma once

#include "contact/cone.hpp"

namespace fclib {

template <class Cone>
typename Cone::Vec alart_curnier_projection(const Cone& cone, const typename Cone::Vec& z) {
  typename Cone::Vec result = z;
  if (!(z[0] > 0)) {
    result.setZero();
    return result;
  }
  for (int g = 0; g < Cone::groups; ++g) {
    auto part = result.template segment<Cone::group_size>(1 + g * Cone::group_size);
    const double norm = part.norm();
    const double radius = cone.coefficient(g) * z[0];
    if (norm > radius) part *= radius / norm;
  }
  return result;
}

/// An element of the generalised Jacobian of alart_curnier_projection at z.
template <class Cone>
ContactMatrix<Cone::dim> alart_curnier_jacobian(const Cone& cone, const typename Cone::Vec& z) {
  constexpr int size = Cone::group_size;
  ContactMatrix<Cone::dim> jacobian = ContactMatrix<Cone::dim>::Zero();
  if (!(z[0] > 0)) return jacobian;
  jacobian(0, 0) = 1;
  for (int g = 0; g < Cone::groups; ++g) {
    const int at = 1 + g * size;
    const auto part = z.template segment<size>(at);
    const double norm = part.norm();
    const double mu = cone.coefficient(g);
    auto block = jacobian.template block<size, size>(at, at);
    block.setIdentity();
    if (norm <= mu * z[0]) continue;
    const Eigen::Matrix<double, size, 1> direction = part / norm;
    block -= direction * direction.transpose();
    block *= mu * z[0] / norm;
    jacobian.template block<size, 1>(at, 0) = mu * direction;
  }
  return jacobian;
}

}  // namespace fclib
