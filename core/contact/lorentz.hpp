// The Lorentz cone x_0 >= ||x_1..|| as a Jordan algebra: what interior-point steps need.
//
// det(x) = x_0^2 - ||x_1..||^2, x o y = (x^T y, x_0 y_1.. + y_0 x_1..). Nesterov & Todd's scaling N
// of x and y inside the cone is symmetric, N^2 y = x, and lambda = N y = N^-1 x.
//
// Alizadeh & Goldfarb, "Second-order cone programming" (2003); the scaling: Nesterov &
// Todd (1997). S is the number of components.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace fclib::lorentz {

template <int S>
using Point = Eigen::Matrix<double, S, 1>;

/// The determinant, without cancellation.
template <int S>
double det(const Point<S>& x) {
  const double t = x.template tail<S - 1>().norm();
  return (x[0] - t) * (x[0] + t);
}

/// det of a point inside the cone. Rounding may have put the point outside.
template <int S>
double inner_det(const Point<S>& x) {
  return std::max(det(x), std::numeric_limits<double>::min());
}

/// The step along d at which x leaves the cone. It is infinite if x never does.
template <int S>
double longest(const Point<S>& x, const Point<S>& d) {
  // the least positive root of det(x + t d) = 0
  const double a = det(d);
  const double b = x[0] * d[0] - x.template tail<S - 1>().dot(d.template tail<S - 1>());
  const double c = std::max(det(x), 0.0);
  double root = std::numeric_limits<double>::infinity();
  const double discriminant = b * b - a * c;
  if (discriminant >= 0) {
    const double s = std::sqrt(discriminant);
    if (b < 0) {
      root = c / (s - b);
    } else if (a < 0) {
      root = -(b + s) / a;
    }
  }
  if (d[0] < 0) root = std::min(root, -x[0] / d[0]);
  return root;
}

/// The y of x o y = target.
template <int S>
Point<S> divide(const Point<S>& target, const Point<S>& x) {
  Point<S> y;
  y[0] = (x[0] * target[0] - x.template tail<S - 1>().dot(target.template tail<S - 1>())) /
         inner_det(x);
  y.template tail<S - 1>() =
      (target.template tail<S - 1>() - y[0] * x.template tail<S - 1>()) / x[0];
  return y;
}

/// Subtracts p o q from a target.
template <int S>
void subtract_product(const Point<S>& p, const Point<S>& q, Point<S>& target) {
  target[0] -= p.dot(q);
  target.template tail<S - 1>() -=
      p[0] * q.template tail<S - 1>() + q[0] * p.template tail<S - 1>();
}

/// N = beta times the square root of 2 w w^T - diag(1, -1, ...), with det(w) = 1.
template <int S>
struct Scaling {
  double beta = 1;
  Point<S> w;
  Eigen::Matrix<double, S, S> N, inverse;

  /// The scaling of x and y, which are inside the cone.
  void set(const Point<S>& x, const Point<S>& y) {
    constexpr int T = S - 1;
    const double det_x = inner_det(x);
    const double det_y = inner_det(y);
    w = x / std::sqrt(det_x);
    const Point<S> unit_y = y / std::sqrt(det_y);
    const double gamma = std::sqrt(0.5 * (1 + w.dot(unit_y)));
    w[0] += unit_y[0];
    w.template tail<T>() -= unit_y.template tail<T>();
    w /= 2 * gamma;
    beta = std::sqrt(std::sqrt(det_x / det_y));
    const Point<T> along = w.template tail<T>();
    N(0, 0) = w[0];
    N.template block<1, T>(0, 1) = along.transpose();
    N.template block<T, 1>(1, 0) = along;
    N.template block<T, T>(1, 1).setIdentity();
    N.template block<T, T>(1, 1) += along * along.transpose() / (1 + w[0]);
    inverse = N / beta;
    inverse.template block<1, T>(0, 1) *= -1;
    inverse.template block<T, 1>(1, 0) *= -1;
    N *= beta;
  }
};

}  // namespace fclib::lorentz
