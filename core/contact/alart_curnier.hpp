// The map of Alart & Curnier, "A mixed formulation for frictional contact problems prone to Newton
// like solution methods" (1991): z_N is clipped at zero, and each tangential group of z (sliding,
// spin and rolling if there are any) is projected on the disk of radius mu max(z_N, 0). Its fixed
// points r = map(r - rho u) are the solutions of the contact law, for any rho > 0.
#pragma once

#include <cmath>

#include "contact/cone.hpp"

namespace fclib {

/// The projection of one group of components. It is written by components, like all code here: each
/// expression of Eigen is a type that takes the compiler long.
template <int size>
double part_norm(const double* part) {
  double sum = 0;
  for (int k = 0; k < size; ++k) sum += part[k] * part[k];
  return std::sqrt(sum);
}

template <class Cone>
typename Cone::Vec alart_curnier_projection(const Cone& cone, const typename Cone::Vec& z) {
  typename Cone::Vec result = z;
  if (!(z[0] > 0)) {
    result.setZero();
    return result;
  }
  for_each_group<Cone>([&](auto g) {
    constexpr int size = Cone::size(g);
    double* const part = &result[Cone::start(g)];
    const double norm = part_norm<size>(part);
    const double radius = cone.coefficient(g) * z[0];
    if (!(norm > radius)) return;
    for (int k = 0; k < size; ++k) part[k] *= radius / norm;
  });
  return result;
}

/// An element of the generalised Jacobian of alart_curnier_projection at z.
template <class Cone>
ContactMatrix<Cone::dim> alart_curnier_jacobian(const Cone& cone, const typename Cone::Vec& z) {
  ContactMatrix<Cone::dim> jacobian;
  jacobian.setZero();
  if (!(z[0] > 0)) return jacobian;
  jacobian(0, 0) = 1;
  for_each_group<Cone>([&](auto g) {
    constexpr int at = Cone::start(g);
    constexpr int size = Cone::size(g);
    const double norm = part_norm<size>(&z[at]);
    const double mu = cone.coefficient(g);
    for (int k = at; k < at + size; ++k) jacobian(k, k) = 1;
    if (norm <= mu * z[0]) return;
    for (int col = at; col < at + size; ++col) {
      for (int row = at; row < at + size; ++row) {
        jacobian(row, col) -= z[row] / norm * (z[col] / norm);
        jacobian(row, col) *= mu * z[0] / norm;
      }
      jacobian(col, 0) = mu * (z[col] / norm);
    }
  });
  return jacobian;
}

}  // namespace fclib
