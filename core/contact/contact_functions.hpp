// Functions F(u, r) of one contact that are zero exactly if the contact law holds, with elements A
// = dF/du and B = dF/dr of their generalised Jacobians. Semismooth Newton methods solve F = 0.
//
//   AlartCurnier        r - its projection of r - rho u: disks of radius mu max(r_N - rho_N u_N, 0)
//   JeanMoreau          the same with disks of radius mu max(r_N, 0)
//   NaturalMap          r - P_K(r - rho u^)
//   FischerBurmeister   x + y - (x o x + y o y)^(1/2), x = (mu r_N, r_T), y = rho (u^_N / mu, u_T),
//                       o the product of the Lorentz cone's Jordan algebra
//
// rho (1/[W]) has an entry for each component. If a function is not `split`, only the first one
// counts. No function is computed as the difference of two large numbers; nor is the natural map.
//
// Alart & Curnier, "A mixed formulation for frictional contact problems prone to Newton like
// solution methods" (1991); Jean & Moreau, "Dynamics in the presence of unilateral contacts and dry
// friction" (1987); Fukushima, Luo & Tseng, "Smoothing functions for second-order-cone
// complementarity problems" (2001); the four side by side in Acary, Bremond & Huber, "On solving
// contact problems with Coulomb friction: formulations and numerical comparisons" (2018).
#pragma once

#include <algorithm>
#include <cmath>

#include "contact/cones.hpp"
#include "contact/inverse.hpp"

namespace fclib {

/// r_N - max(0, r_N - rho_N u_N), and r_g - P(r_g - rho_g u_g) on disks of radius
/// mu_g max(0, r_N - rho_N u_N), or mu_g max(0, r_N).
template <class ConeType, bool predicted>
struct DiskFunction {
  using Cone = ConeType;
  static constexpr int D = Cone::dim;
  static constexpr bool split = true;
  using Vec = typename Cone::Vec;
  using Mat = ContactMatrix<D>;

  static Vec value(const Cone& cone, const Vec& rho, const Vec& u, const Vec& r) {
    const Vec z = r - rho.cwiseProduct(u);
    Vec f = r;
    if (z[0] > 0) f[0] = rho[0] * u[0];
    const double base = predicted ? z[0] : r[0];
    for_each_group<Cone>([&](auto g) {
      constexpr int at = Cone::start(g);
      constexpr int S = Cone::size(g);
      const ContactVector<S> part = z.template segment<S>(at);
      const double norm = part.norm();
      const double radius = cone.coefficient(g) * std::max(base, 0.0);
      if (base > 0 && norm <= radius) {
        f.template segment<S>(at) = (rho.cwiseProduct(u)).template segment<S>(at);
      } else if (radius > 0) {
        f.template segment<S>(at) -= (radius / norm) * part;
      }
    });
    return f;
  }

  static void jacobian(const Cone& cone, const Vec& rho, const Vec& u, const Vec& r, Mat& A,
                       Mat& B) {
    const Vec z = r - rho.cwiseProduct(u);
    A.setZero();
    B.setIdentity();
    if (z[0] > 0) {
      A(0, 0) = rho[0];
      B(0, 0) = 0;
    }
    const double base = predicted ? z[0] : r[0];
    if (!(base > 0)) return;
    for_each_group<Cone>([&](auto g) {
      constexpr int at = Cone::start(g);
      constexpr int S = Cone::size(g);
      const ContactVector<S> part = z.template segment<S>(at);
      const double norm = part.norm();
      const double mu = cone.coefficient(g);
      auto own = B.template block<S, S>(at, at);
      auto other = A.template block<S, S>(at, at);
      if (norm <= mu * base) {
        own.setZero();
        other = rho.template segment<S>(at).asDiagonal();
        return;
      }
      // the projection of `part` on the disk: mu base part / ||part||
      const ContactVector<S> direction = part / norm;
      Eigen::Matrix<double, S, S> jacobian = Eigen::Matrix<double, S, S>::Identity();
      jacobian -= direction * direction.transpose();
      jacobian *= mu * base / norm;
      own -= jacobian;
      other = jacobian * rho.template segment<S>(at).asDiagonal();
      B.template block<S, 1>(at, 0) = -mu * direction;
      if (predicted) A.template block<S, 1>(at, 0) = mu * rho[0] * direction;
    });
  }
};

template <class Cone>
using AlartCurnier = DiskFunction<Cone, true>;
template <class Cone>
using JeanMoreau = DiskFunction<Cone, false>;

/// The derivative of u^ by u. It is zero at the kink of the norm.
template <class Cone>
ContactMatrix<Cone::dim> modified_jacobian(const Cone& cone, const typename Cone::Vec& u) {
  ContactMatrix<Cone::dim> jacobian = ContactMatrix<Cone::dim>::Identity();
  for_each_group<Cone>([&](auto g) {
    constexpr int at = Cone::start(g);
    constexpr int S = Cone::size(g);
    const auto part = u.template segment<S>(at);
    const double norm = part.norm();
    if (norm > 0) {
      jacobian.template block<1, S>(0, at) = (cone.coefficient(g) / norm) * part.transpose();
    }
  });
  return jacobian;
}

/// An element of the generalised Jacobian of P_K at z.
template <class Cone>
ContactMatrix<Cone::dim> projection_jacobian(const Cone& cone, const typename Cone::Vec& z) {
  using Vec = typename Cone::Vec;
  using Mat = ContactMatrix<Cone::dim>;
  const Vec p = cone.project(z);
  if (p == z) return Mat::Identity();
  if (!(p[0] > 0)) return Mat::Zero();
  // p_N = (z_N + sum mu_g ||z_g||) / (1 + sum mu_g^2) over the groups whose limit binds
  Vec normal = Vec::Unit(0);
  double weight = 1;
  for_each_group<Cone>([&](auto g) {
    constexpr int at = Cone::start(g);
    constexpr int S = Cone::size(g);
    const double mu = cone.coefficient(g);
    const double norm = z.template segment<S>(at).norm();
    if (norm > mu * p[0]) {
      normal.template segment<S>(at) = (mu / norm) * z.template segment<S>(at);
      weight += mu * mu;
    }
  });
  normal /= weight;
  Mat jacobian = Mat::Identity();
  jacobian.row(0) = normal.transpose();
  for_each_group<Cone>([&](auto g) {
    constexpr int at = Cone::start(g);
    constexpr int S = Cone::size(g);
    const double mu = cone.coefficient(g);
    const double norm = z.template segment<S>(at).norm();
    if (!(norm > mu * p[0])) return;
    const Eigen::Matrix<double, S, 1> direction = z.template segment<S>(at) / norm;
    auto own = jacobian.template block<S, S>(at, at);
    own -= direction * direction.transpose();
    own *= mu * p[0] / norm;
    jacobian.template middleRows<S>(at) += (mu * direction) * normal.transpose();
  });
  return jacobian;
}

template <class ConeType>
struct NaturalMap {
  using Cone = ConeType;
  static constexpr bool split = false;
  using Vec = typename Cone::Vec;
  using Mat = ContactMatrix<Cone::dim>;

  static Vec value(const Cone& cone, const Vec& rho, const Vec& u, const Vec& r) {
    return natural_map(cone, u, r, rho[0]);
  }

  static void jacobian(const Cone& cone, const Vec& rho, const Vec& u, const Vec& r, Mat& A,
                       Mat& B) {
    const Vec z = r - rho[0] * cone.modified(u);
    const Mat jacobian = projection_jacobian(cone, z);
    B = Mat::Identity() - jacobian;
    A = rho[0] * jacobian * modified_jacobian(cone, u);
  }
};

/// On the cone of Coulomb; without friction, the scalar function for r_N and u_N, and r_T.
template <class ConeType>
struct FischerBurmeister {
  using Cone = ConeType;
  static constexpr int D = Cone::dim;
  static constexpr int T = D - 1;
  static constexpr bool split = false;
  using Vec = typename Cone::Vec;
  using Mat = ContactMatrix<D>;

  static Vec value(const Cone& cone, const Vec& rho, const Vec& u, const Vec& r) {
    if (!(cone.mu() > 0)) {
      Vec f = r;
      f[0] = scalar(r[0], rho[0] * u[0]);
      return f;
    }
    const Vec x = primal(cone, r);
    const Vec y = dual(cone, rho[0], u);
    return x + y - Root(x, y).root;
  }

  static void jacobian(const Cone& cone, const Vec& rho, const Vec& u, const Vec& r, Mat& A,
                       Mat& B) {
    const double mu = cone.mu();
    if (!(mu > 0)) {
      A.setZero();
      B.setIdentity();
      const double y = rho[0] * u[0];
      const double norm = std::hypot(r[0], y);
      const double flat = 1 - std::sqrt(0.5);
      A(0, 0) = rho[0] * (norm > 0 ? 1 - y / norm : flat);
      B(0, 0) = norm > 0 ? 1 - r[0] / norm : flat;
      return;
    }
    const Vec x = primal(cone, r);
    const Vec y = dual(cone, rho[0], u);
    const Root root(x, y);
    root.jacobian(x, B);
    root.jacobian(y, A);
    B.col(0) *= mu;
    // y = rho S u^
    Mat scaled = modified_jacobian(cone, u);
    scaled.row(0) /= mu;
    A = rho[0] * A * scaled;
  }

 private:
  static double scalar(double x, double y) {
    const double sum = x + y;
    const double norm = std::hypot(x, y);
    return sum > 0 ? 2 * x * y / (sum + norm) : sum - norm;
  }
  static Vec primal(const Cone& cone, const Vec& r) {
    Vec x = r;
    x[0] *= cone.mu();
    return x;
  }
  static Vec dual(const Cone& cone, double rho, const Vec& u) {
    Vec y = rho * cone.modified(u);
    y[0] /= cone.mu();
    return y;
  }

  /// (x o x + y o y)^(1/2) by its spectral values, and the Jacobians of x + y less it.
  struct Root {
    Root(const Vec& x, const Vec& y) {
      Vec square;
      square[0] = x.squaredNorm() + y.squaredNorm();
      square.template tail<T>() = 2 * (x[0] * x.template tail<T>() + y[0] * y.template tail<T>());
      const double norm = square.template tail<T>().norm();
      high = std::sqrt(square[0] + norm);
      low = std::sqrt(std::max(square[0] - norm, 0.0));
      direction.setZero();
      if (norm > 0) direction = square.template tail<T>() / norm;
      root[0] = 0.5 * (high + low);
      root.template tail<T>() = 0.5 * (high - low) * direction;
    }

    /// I - L(root)^-1 L(x), L(a) b = a o b. If L(root) is singular, a limit of it.
    void jacobian(const Vec& x, Mat& result) const {
      if (!(high > 0)) {
        result = (1 - std::sqrt(0.5)) * Mat::Identity();
        return;
      }
      constexpr double least = 1e-8;
      const double floor = std::max(low, least * high);
      Mat arrow = arrow_of(0.5 * (high + floor), Vec(root));
      arrow.template block<1, T>(0, 1) = 0.5 * (high - floor) * direction.transpose();
      arrow.template block<T, 1>(1, 0) = 0.5 * (high - floor) * direction;
      result = Mat::Identity() - inverse<D>(arrow) * arrow_of(x[0], x);
    }

    static Mat arrow_of(double head, const Vec& x) {
      Mat arrow = head * Mat::Identity();
      arrow.template block<1, T>(0, 1) = x.template tail<T>().transpose();
      arrow.template block<T, 1>(1, 0) = x.template tail<T>();
      return arrow;
    }

    double low, high;
    Eigen::Matrix<double, T, 1> direction;
    Vec root;
  };
};

enum class ContactFunctionKind { alart_curnier, jean_moreau, natural_map, fischer_burmeister };

/// One of these functions, in the form that its callers need. A = dF/du and B = dF/dr are elements
/// of the generalised Jacobian.
template <class Cone>
struct ContactFunction {
  using Vec = typename Cone::Vec;
  using Mat = ContactMatrix<Cone::dim>;

  Vec (*value)(const Cone& cone, const Vec& rho, const Vec& u, const Vec& r) = nullptr;
  void (*jacobian)(const Cone& cone, const Vec& rho, const Vec& u, const Vec& r, Mat& A,
                   Mat& B) = nullptr;
  bool split = false;  ///< whether each component has a rho of its own
};

/// Throws Error (unsuitable) if Fischer & Burmeister's function is asked for on a cone
/// of more than one group.
template <class Cone>
ContactFunction<Cone> contact_function(ContactFunctionKind kind);

}  // namespace fclib
