// The problem of one contact by damped nonsmooth Newton methods: given A = W_aa and b = u - A r,
// find the zero of a function whose zeros r obey the contact law together with u = A r + b.
//
//   Alart-Curnier:      Phi(r) = r - map(r - R u), the projection with steps R from the diagonal of
//   A Fischer-Burmeister: Phi(r) = x + y - (x o x + y o y)^(1/2) in the Jordan algebra of the
//                       second-order cone, with x = (mu r_N, r_T), y = s (u^_N / mu, u_T)
//
// Alart & Curnier, "A mixed formulation for frictional contact problems prone to Newton like
// solution methods" (1991); Fukushima, Luo & Tseng, "Smoothing functions for second-order-cone
// complementarity problems" (2002).
//
// Both halve the Newton step until ||Phi|| falls. If that fails, they return false and leave r
// untouched.
#pragma once

#include <algorithm>
#include <cmath>

#include "contact/alart_curnier.hpp"
#include "contact/coulomb.hpp"
#include "contact/inverse.hpp"
#include "function_ref.hpp"

namespace fclib {

namespace detail {

// By components: each expression of Eigen is a type that takes the compiler long.

/// A x + b.
template <int D>
ContactVector<D> affine(const ContactMatrix<D>& a, const ContactVector<D>& x,
                        const ContactVector<D>& b) {
  ContactVector<D> result = a * x;
  for (int k = 0; k < D; ++k) result[k] += b[k];
  return result;
}

/// I - A B.
template <int D>
ContactMatrix<D> one_less(const ContactMatrix<D>& a, const ContactMatrix<D>& b) {
  ContactMatrix<D> result = a * b;
  for (int col = 0; col < D; ++col) {
    for (int row = 0; row < D; ++row) {
      result(row, col) = (row == col ? 1.0 : 0.0) - result(row, col);
    }
  }
  return result;
}

template <int D>
bool all_finite(const ContactVector<D>& x) {
  bool finite = true;
  for (int k = 0; k < D; ++k) finite = finite && std::isfinite(x[k]);
  return finite;
}

/// Phi near a point: an element of its generalised Jacobian, and the size of what it is the
/// difference of. Rounding in Phi is in proportion to this size.
template <int D>
struct Linearised {
  ContactMatrix<D> jacobian;
  double size;
};

/// Damped Newton on `function(r, near)`. The function returns Phi. If near is not null, it fills it
/// in. Phi is zero up to rounding at accuracy times its size.
template <int D>
bool damped_newton(FunctionRef<ContactVector<D>(const ContactVector<D>&, Linearised<D>*)> function,
                   double accuracy, int max_iterations, ContactVector<D>& r) {
  constexpr int max_halvings = 12;
  constexpr double sufficient = 1e-4;  // share of the decrease that the model promises
  constexpr double rounding = 1e-12;   // if no step reduces Phi and it is below this, Phi is zero
  ContactVector<D> x = r;
  Linearised<D> near;
  ContactVector<D> phi = function(x, &near);
  double norm = part_norm<D>(phi.data());
  for (int k = 0; k < max_iterations && norm > accuracy * near.size; ++k) {
    const ContactMatrix<D> inverted = inverse<D>(near.jacobian);
    const ContactVector<D> step = inverted * phi;
    double length = 1;
    bool falls = false;
    for (int halving = 0; halving < max_halvings && !falls; ++halving, length *= 0.5) {
      ContactVector<D> trial;
      for (int c = 0; c < D; ++c) trial[c] = x[c] - length * step[c];
      const double trial_norm = part_norm<D>(function(trial, nullptr).data());
      falls = trial_norm <= (1 - sufficient * length) * norm;
      if (falls) x = trial;
    }
    if (!falls) break;
    phi = function(x, &near);
    norm = part_norm<D>(phi.data());
  }
  if (!std::isfinite(near.size)) return false;  // squares overflow: any Phi would pass
  if (!(norm <= std::max(accuracy, rounding) * near.size)) return false;
  r = x;
  return true;
}

}  // namespace detail

template <class Cone>
bool newton_alart_curnier(const ContactMatrix<Cone::dim>& a, const Cone& cone,
                          const typename Cone::Vec& b, double accuracy, int max_iterations,
                          typename Cone::Vec& r) {
  constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;
  using Mat = ContactMatrix<D>;
  if (b[0] >= 0) {
    r.setZero();
    return true;
  }
  Vec steps;
  steps[0] = 1 / a(0, 0);
  for_each_group<Cone>([&](auto g) {
    constexpr int at = Cone::start(g);
    constexpr int size = Cone::size(g);
    double trace = 0;
    for (int k = at; k < at + size; ++k) trace += a(k, k);
    // no reaction moves a group without trace: any step serves
    for (int k = at; k < at + size; ++k) steps[k] = trace == 0 ? steps[0] : size / trace;
  });
  for (int k = 0; k < D; ++k) {
    if (!(steps[k] > 0) || !std::isfinite(steps[k])) return false;
  }
  Mat free;  // d (r - R u) / d r
  for (int col = 0; col < D; ++col) {
    for (int row = 0; row < D; ++row) {
      free(row, col) = (row == col ? 1.0 : 0.0) - steps[row] * a(row, col);
    }
  }
  Vec scaled;
  for (int k = 0; k < D; ++k) scaled[k] = steps[k] * b[k];
  using Near = detail::Linearised<D>;
  const auto function = [&](const Vec& x, Near* near) -> Vec {
    const Vec u = detail::affine<D>(a, x, b);
    Vec z;
    for (int k = 0; k < D; ++k) z[k] = x[k] - steps[k] * u[k];
    const Vec projected = alart_curnier_projection(cone, z);
    Vec phi;
    for (int k = 0; k < D; ++k) phi[k] = x[k] - projected[k];
    if (near == nullptr) return phi;
    near->jacobian = detail::one_less<D>(alart_curnier_jacobian(cone, z), free);
    // x and R b; but of a group outside its disk only the direction counts
    const double normal = std::abs(x[0]) + std::abs(scaled[0]);
    double squares = normal * normal;
    for_each_group<Cone>([&](auto g) {
      constexpr int at = Cone::start(g);
      constexpr int size = Cone::size(g);
      double share = part_norm<size>(&x[at]) + part_norm<size>(&scaled[at]);
      const bool inside = part_norm<size>(&z[at]) <= cone.coefficient(g) * z[0];
      if (!inside) share = std::min(share, cone.coefficient(g) * normal);
      squares += share * share;
      if (!inside) return;
      for (int k = at; k < at + size; ++k) {
        if (a(k, k) == 0) near->jacobian(k, k) = 1;  // a row of zeros: Phi_k depends on no r
      }
    });
    near->size = std::sqrt(squares);
    return phi;
  };
  const Vec before = r;
  if (!detail::damped_newton<D>(function, accuracy, max_iterations, r)) return false;
  r = cone.project(r);  // rounding may have left the cone
  if (detail::all_finite<D>(r)) return true;
  r = before;
  return false;
}

template <int D>
bool newton_fischer_burmeister(const ContactMatrix<D>& a, const Coulomb<D>& cone,
                               const ContactVector<D>& b, double accuracy, int max_iterations,
                               ContactVector<D>& r) {
  using Vec = ContactVector<D>;
  using Mat = ContactMatrix<D>;
  constexpr int T = D - 1;
  constexpr double least_friction = 1e-8;  // below this, y is out of scale
  if (b[0] >= 0) {
    r.setZero();
    return true;
  }
  const double mu = cone.mu();
  double trace = 0;
  for (int k = 0; k < D; ++k) trace += a(k, k);
  if (mu < least_friction || !(trace > 0)) return false;
  const double scale = D / trace;
  // L_x, the matrix of the product x o .
  const auto arrow = [](const Vec& x) {
    Mat result;
    result.setZero();
    for (int k = 0; k < D; ++k) {
      result(k, k) = x[0];
      result(0, k) = result(k, 0) = x[k];
    }
    return result;
  };
  // (s)^(1/2) by the spectral values of s
  const auto root = [](const Vec& s) {
    const double tangent = part_norm<T>(&s[1]);
    const double high = std::sqrt(std::max(s[0] + tangent, 0.0));
    const double low = std::sqrt(std::max(s[0] - tangent, 0.0));
    Vec result;
    result[0] = 0.5 * (high + low);
    const double part = tangent > 0 ? 0.5 * (high - low) / tangent : 0.0;
    for (int k = 1; k < D; ++k) result[k] = part * s[k];
    return result;
  };
  const double size = part_norm<D>(r.data()) + scale * part_norm<D>(b.data());
  const auto function = [&](const Vec& reaction, detail::Linearised<D>* near) -> Vec {
    Vec x = reaction;
    x[0] *= mu;
    Vec y = detail::affine<D>(a, reaction, b);
    for (int k = 0; k < D; ++k) y[k] *= scale;
    const double sliding = Coulomb<D>::tangential_norm(y);
    y[0] = y[0] / mu + sliding;
    const Mat product_x = arrow(x);
    const Mat product_y = arrow(y);
    const Vec square_y = product_y * y;
    const Vec squares = detail::affine<D>(product_x, x, square_y);
    Vec phi = root(squares);
    for (int k = 0; k < D; ++k) phi[k] = x[k] + y[k] - phi[k];
    if (near != nullptr) {
      near->size = size;
      // smoothed by what is negligible beside Phi, so that the root has an inverse
      Vec smooth = squares;
      double square = 0;
      for (int k = 0; k < D; ++k) square += phi[k] * phi[k];
      smooth[0] += 1e-8 * square + 1e-30 * squares[0];
      const Mat divided = inverse<D>(arrow(root(smooth)));
      Mat y_jacobian;
      for (int col = 0; col < D; ++col) {
        for (int row = 0; row < D; ++row) y_jacobian(row, col) = scale * a(row, col);
        double slid = 0;
        for (int row = 1; row < D; ++row) slid += y[row] * y_jacobian(row, col);
        y_jacobian(0, col) = y_jacobian(0, col) / mu + (sliding > 0 ? slid / sliding : 0.0);
      }
      // (I - divided L_x) diag(mu, 1, 1) + (I - divided L_y) dy/dr
      near->jacobian = detail::one_less<D>(divided, product_y) * y_jacobian;
      const Mat by_x = detail::one_less<D>(divided, product_x);
      for (int col = 0; col < D; ++col) {
        const double unit = col == 0 ? mu : 1.0;
        for (int row = 0; row < D; ++row) near->jacobian(row, col) += unit * by_x(row, col);
      }
    }
    return phi;
  };
  Vec x = r;
  if (!detail::damped_newton<D>(function, accuracy, max_iterations, x)) return false;
  x = cone.project(x);
  if (!detail::all_finite<D>(x)) return false;
  r = x;
  return true;
}

}  // namespace fclib
