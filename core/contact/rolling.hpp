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
  static constexpr int groups = 2;       // sliding, rolling
  static constexpr int lengths = 1 + T;  // N and T are lengths, see Friction
  static constexpr int start(int group) { return 1 + group * T; }
  static constexpr int size(int /*group*/) { return T; }
  using Vec = ContactVector<D, Real>;
  using Slack = std::array<Real, groups>;

  Rolling(Real mu, Real mu_r) : mu_(mu), mu_r_(mu_r) {}
  Rolling(const Friction& friction, Eigen::Index contact)
      : mu_(friction.mu[contact]), mu_r_(friction.mu_r[contact]) {}

  /// The limit of a group is ||r_group|| <= coefficient r_N.
  [[nodiscard]] Real coefficient(int group) const { return group == 0 ? mu_ : mu_r_; }

  [[nodiscard]] Vec modified(const Vec& u) const;

  /// The normal part n of the projection is the root of this increasing function:
  ///   n - x_N - mu max(0, ||x_T|| - mu n) - mu_r max(0, ||x_R|| - mu_r n),
  /// It is linear between the values of n at which a limit stops binding.
  [[nodiscard]] Vec project(const Vec& x) const;

  /// As for Coulomb, with s_T = rho ||u_T|| and s_R = rho ||u_R||: see the definition.
  [[nodiscard]] NaturalPoint<Vec> natural(const Vec& u, const Vec& r, Real rho,
                                          const Slack& slack) const;

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
  // only the limit that binds longest, or both
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

// The projection of y = r - rho u^ cuts ||y_T|| by c_T and ||y_R|| by c_R, so that
//
//   F_N = rho u_N + mu (s_T - c_T) + mu_r (s_R - c_R),   F_T = rho u_T + c_T y_T / ||y_T||,  F_R
//   alike
//
// and its normal part is n = a + mu (c_T - s_T) + mu_r (c_R - s_R), a = r_N - rho u_N. If a limit
// binds, c = ||y|| - limit n > 0; else c = 0. The large parts, mu s_T and mu_r s_R, cancel in these
// sums before they are formed.
template <int D, class Real>
auto Rolling<D, Real>::natural(const Vec& u, const Vec& r, Real rho, const Slack& slack) const
    -> NaturalPoint<Vec> {
  Vec map = rho * u;
  const Vec y = r - map;
  const Real a = y[0];
  const Real t = tangential_norm(y);
  const Real q = rolling_norm(y);
  const Real slip_t = rho * above_slack(tangential_norm(u), slack[0]);
  const Real slip_r = rho * above_slack(rolling_norm(u), slack[1]);
  const Real left_t = t - slip_t;
  const Real left_r = q - slip_r;
  if (a + mu_ * left_t + mu_r_ * left_r <= 0) return {r, ContactStatus::open};
  const Real pressed = a - mu_ * slip_t - mu_r_ * slip_r;
  if (pressed >= 0 && t <= mu_ * pressed && q <= mu_r_ * pressed) {
    map[0] += mu_ * slip_t + mu_r_ * slip_r;
    return {map, ContactStatus::stick};
  }
  // as n grows, only the limit that binds longest binds, or both do
  const bool sliding = t * mu_r_ >= q * mu_;
  const Real limit = sliding ? mu_ : mu_r_;
  const Real left = sliding ? left_t : left_r;
  const Real idle = sliding ? mu_r_ * slip_r : mu_ * slip_t;
  const Real weight = 1 + limit * limit;
  const Real n = (a + limit * left - idle) / weight;
  const bool both = sliding ? q > mu_r_ * n : t > mu_ * n;
  Real cut_t = 0;
  Real cut_r = 0;
  if (both) {
    const Real total = weight + (sliding ? mu_r_ * mu_r_ : mu_ * mu_);
    const Real turn = mu_r_ * left_t - mu_ * left_r;
    const Real beyond_t = left_t - mu_ * a;
    const Real beyond_r = left_r - mu_r_ * a;
    cut_t = slip_t + (beyond_t + mu_r_ * turn) / total;
    cut_r = slip_r + (beyond_r - mu_ * turn) / total;
    map[0] -= (mu_ * beyond_t + mu_r_ * beyond_r) / total;
  } else {
    (sliding ? cut_t : cut_r) = (sliding ? slip_t : slip_r) + (left - limit * (a - idle)) / weight;
    map[0] -= (limit * (left - limit * a) - idle) / weight;
  }
  // if a cut is NaN, the result must show it
  if (!(cut_t <= 0) && t != 0) map.template segment<T>(1) += cut_t / t * y.template segment<T>(1);
  if (!(cut_r <= 0) && q != 0)
    map.template segment<T>(1 + T) += cut_r / q * y.template segment<T>(1 + T);
  return {map, ContactStatus::slide};
}

// with other numbers they are compiled where they are used
extern template class Rolling<3>;
extern template class Rolling<5>;

}  // namespace fclib
