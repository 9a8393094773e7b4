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
// Both halve the Newton step until ||Phi|| falls. False, with r untouched, where that fails.
#pragma once

#include <algorithm>
#include <cmath>

#include "contact/alart_curnier.hpp"
#include "contact/coulomb.hpp"
#include "contact/inverse.hpp"
#include "function_ref.hpp"

namespace fclib {

namespace detail {

/// Damped Newton on `function(r, jacobian)`, which returns Phi and, where jacobian is not null,
/// fills in an element of its generalised Jacobian. Phi is zero to rounding at accuracy times
/// `size`.
template <int D>
bool damped_newton(
    FunctionRef<ContactVector<D>(const ContactVector<D>&, ContactMatrix<D>*)> function, double size,
    double accuracy, int max_iterations, ContactVector<D>& r) {
  constexpr int max_halvings = 12;
  constexpr double sufficient = 1e-4;  // of the decrease that the model promises
  constexpr double rounding = 1e-12;   // Phi that no step reduces is taken for zero below this
  ContactVector<D> x = r;
  ContactMatrix<D> jacobian;
  ContactVector<D> phi = function(x, &jacobian);
  double norm = phi.norm();
  for (int k = 0; k < max_iterations && norm > accuracy * size; ++k) {
    const ContactVector<D> step = -(inverse<D>(jacobian) * phi);
    double length = 1;
    bool falls = false;
    for (int halving = 0; halving < max_halvings && !falls; ++halving, length *= 0.5) {
      const ContactVector<D> trial = x + length * step;
      const double trial_norm = function(trial, nullptr).norm();
      falls = trial_norm <= (1 - sufficient * length) * norm;
      if (falls) x = trial;
    }
    if (!falls) break;
    phi = function(x, &jacobian);
    norm = phi.norm();
  }
  if (!(norm <= std::max(accuracy, rounding) * size)) return false;
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
  for (int g = 0; g < Cone::groups; ++g) {
    constexpr int size = Cone::group_size;
    const int at = 1 + g * size;
    steps.template segment<size>(at).setConstant(size /
                                                 a.template block<size, size>(at, at).trace());
  }
  if (!(steps.minCoeff() > 0) || !steps.allFinite()) return false;
  const Mat free = Mat::Identity() - steps.asDiagonal() * a;  // d (r - R u) / d r
  const auto function = [&](const Vec& x, Mat* jacobian) -> Vec {
    const Vec z = x - steps.cwiseProduct(a * x + b);
    if (jacobian != nullptr) *jacobian = Mat::Identity() - alart_curnier_jacobian(cone, z) * free;
    return x - alart_curnier_projection(cone, z);
  };
  const double size = r.norm() + steps.cwiseProduct(b).norm();
  const Vec before = r;
  if (!detail::damped_newton<D>(function, size, accuracy, max_iterations, r)) return false;
  r = cone.project(r);  // rounding leaves the cone
  if (r.allFinite()) return true;
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
  constexpr double least_friction = 1e-8;  // below it y is out of scale
  if (b[0] >= 0) {
    r.setZero();
    return true;
  }
  const double mu = cone.mu();
  const double trace = a.trace();
  if (mu < least_friction || !(trace > 0)) return false;
  const double scale = D / trace;
  // L_x, the matrix of the product x o .
  const auto arrow = [](const Vec& x) {
    Mat result = x[0] * Mat::Identity();
    result.template block<1, T>(0, 1) = x.template tail<T>().transpose();
    result.template block<T, 1>(1, 0) = x.template tail<T>();
    return result;
  };
  // (s)^(1/2) by the spectral values of s
  const auto root = [](const Vec& s) {
    const double tangent = s.template tail<T>().norm();
    const double high = std::sqrt(std::max(s[0] + tangent, 0.0));
    const double low = std::sqrt(std::max(s[0] - tangent, 0.0));
    Vec result = Vec::Zero();
    result[0] = 0.5 * (high + low);
    if (tangent > 0)
      result.template tail<T>() = (0.5 * (high - low) / tangent) * s.template tail<T>();
    return result;
  };
  const auto function = [&](const Vec& reaction, Mat* jacobian) -> Vec {
    Vec x = reaction;
    x[0] *= mu;
    Vec y = scale * (a * reaction + b);
    const double sliding = Coulomb<D>::tangential_norm(y);
    y[0] = y[0] / mu + sliding;
    const Mat product_x = arrow(x);
    const Mat product_y = arrow(y);
    const Vec squares = product_x * x + product_y * y;
    const Vec phi = x + y - root(squares);
    if (jacobian != nullptr) {
      // smoothed by what is negligible beside Phi, so that the root has an inverse
      Vec smooth = squares;
      smooth[0] += 1e-8 * phi.squaredNorm() + 1e-30 * squares[0];
      const Mat divided = inverse<D>(arrow(root(smooth)));
      Mat x_jacobian = Mat::Identity();
      x_jacobian(0, 0) = mu;
      Mat y_jacobian = scale * a;
      y_jacobian.row(0) /= mu;
      if (sliding > 0) {
        y_jacobian.row(0) +=
            (y.template tail<T>() / sliding).transpose() * (scale * a.template bottomRows<T>());
      }
      *jacobian = x_jacobian - divided * product_x * x_jacobian + y_jacobian -
                  divided * product_y * y_jacobian;
    }
    return phi;
  };
  Vec x = r;
  const double size = r.norm() + scale * b.norm();
  if (!detail::damped_newton<D>(function, size, accuracy, max_iterations, x)) return false;
  x = cone.project(x);
  if (!x.allFinite()) return false;
  r = x;
  return true;
}

}  // namespace fclib
