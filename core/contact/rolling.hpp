// The cone of a contact with sliding and rolling friction,
//
//   K = { ||r_T|| <= mu r_N, ||r_R|| <= mu_r r_N }
//   u^ = u + [mu ||u_T|| + mu_r ||u_R||, 0, ...]
//
// with components N, T1, T2, R1, R2 in space (dim 5) and N, T, R in the plane (dim 3).
//
// Acary & Bourrier, "Coulomb friction with rolling resistance as a cone complementarity problem"
// (2021).
#pragma once

#include <algorithm>

#include "contact/cone.hpp"

namespace fclib {

template <int D, class Real = double>
class Rolling {
  static_assert(D == 3 || D == 5);
  static constexpr int T = (D - 1) / 2;  // tangential components, and rolling ones

 public:
  static constexpr int dim = D;
  static constexpr int groups = 2;      // sliding, rolling
  static constexpr int group_size = T;  // components of a group
  using Vec = ContactVector<D, Real>;

  Rolling(Real mu, Real mu_r) : mu_(mu), mu_r_(mu_r) {}
  Rolling(const Friction& friction, Eigen::Index contact)
      : mu_(friction.mu[contact]), mu_r_(friction.mu_r[contact]) {}

  /// Of a group: ||r_group|| <= coefficient r_N.
  [[nodiscard]] Real coefficient(int group) const { return group == 0 ? mu_ : mu_r_; }

  [[nodiscard]] Vec modified(const Vec& u) const;

  /// The normal part n of the projection is the root of the increasing function
  ///   n - x_N - mu max(0, ||x_T|| - mu n) - mu_r max(0, ||x_R|| - mu_r n),
  /// linear but for the values of n at which a limit ceases to bind.
  [[nodiscard]] Vec project(const Vec& x) const;

  [[nodiscard]] Vec outside(const Vec& x) const;

 private:
  static Real tangential_norm(const Vec& x) { return x.template segment<T>(1).norm(); }
  static Real rolling_norm(const Vec& x) { return x.template segment<T>(1 + T).norm(); }

  Real mu_;
  Real mu_r_;
};

template <int D, class Real>
auto Rolling<D, Real>::modified(const Vec& u) const -> Vec {
  Vec result = u;
  result[0] += mu_ * tangential_norm(u) + mu_r_ * rolling_norm(u);
  return result;
}

template <int D, class Real>
auto Rolling<D, Real>::project(const Vec& x) const -> Vec {
  const Real t = tangential_norm(x);
  const Real r = rolling_norm(x);
  if (x[0] >= 0 && t <= mu_ * x[0] && r <= mu_r_ * x[0]) return x;
  if (x[0] + mu_ * t + mu_r_ * r <= 0) return Vec::Zero();
  const Real free_t = t > 0 ? t / mu_ : Real(0);
  const Real free_r = r > 0 ? r / mu_r_ : Real(0);
  // the limit that binds longest, alone, or both
  const bool sliding = free_t >= free_r;
  const Real limit = sliding ? mu_ : mu_r_;
  Real n = (x[0] + limit * (sliding ? t : r)) / (1 + limit * limit);
  if (n < std::min(free_t, free_r)) {
    n = (x[0] + mu_ * t + mu_r_ * r) / (1 + mu_ * mu_ + mu_r_ * mu_r_);
  }
  Vec result = x;
  result[0] = n;
  if (t > mu_ * n) result.template segment<T>(1) *= mu_ * n / t;
  if (r > mu_r_ * n) result.template segment<T>(1 + T) *= mu_r_ * n / r;
  return result;
}

template <int D, class Real>
auto Rolling<D, Real>::outside(const Vec& x) const -> Vec {
  const Real t = tangential_norm(x);
  const Real r = rolling_norm(x);
  // beyond their limits at n = x_N
  const Real beyond_t = t - mu_ * x[0];
  const Real beyond_r = r - mu_r_ * x[0];
  if (x[0] >= 0 && beyond_t <= 0 && beyond_r <= 0) return Vec::Zero();
  if (x[0] + mu_ * t + mu_r_ * r <= 0) return x;
  // n - x_N with one limit that binds, or with both: see project()
  const bool sliding = t > 0 && (!(r > 0) || t * mu_r_ >= r * mu_);
  const Real limit = sliding ? mu_ : mu_r_;
  Real rise = limit * (sliding ? beyond_t : beyond_r) / (1 + limit * limit);
  Real left_t = beyond_t - mu_ * rise;
  Real left_r = beyond_r - mu_r_ * rise;
  if (left_t > 0 && left_r > 0) {
    rise = (mu_ * beyond_t + mu_r_ * beyond_r) / (1 + mu_ * mu_ + mu_r_ * mu_r_);
    left_t = beyond_t - mu_ * rise;
    left_r = beyond_r - mu_r_ * rise;
  }
  Vec result = Vec::Zero();
  result[0] = -rise;
  if (left_t > 0) result.template segment<T>(1) = left_t / t * x.template segment<T>(1);
  if (left_r > 0) result.template segment<T>(1 + T) = left_r / r * x.template segment<T>(1 + T);
  return result;
}

// with other numbers they are compiled where they are used
extern template class Rolling<3>;
extern template class Rolling<5>;

}  // namespace fclib
