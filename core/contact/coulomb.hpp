// The Coulomb cone K = { ||r_T|| <= mu r_N } of one contact, in d = 2 or 3 dimensions. With d = 4
// it is the cone of reduced/round.hpp.
//
//   u^ = u + [mu ||u_T||, 0, 0]
#pragma once

#include <cmath>

#include "contact/cone.hpp"

namespace fclib {

template <int D, class Real = double>
class Coulomb {
 public:
  static constexpr int dim = D;
  static constexpr int groups = 1;   // of tangential components, each with its own limit
  static constexpr int lengths = D;  // N and T are lengths, see Friction
  static constexpr int start(int /*group*/) { return 1; }
  static constexpr int size(int /*group*/) { return D - 1; }
  using Vec = ContactVector<D, Real>;
  using Slack = std::array<Real, groups>;

  explicit Coulomb(Real mu) : mu_(mu) {}
  Coulomb(const Friction& friction, Eigen::Index contact) : mu_(friction.mu[contact]) {}

  [[nodiscard]] Real mu() const { return mu_; }
  /// The limit of a group is ||r_group|| <= coefficient r_N.
  [[nodiscard]] Real coefficient(int /*group*/) const { return mu_; }

  /// ||x_T||
  static Real tangential_norm(const Vec& x) {
    if constexpr (D == 2) {
      using std::abs;  // or that of Real
      return abs(x[1]);
    } else if constexpr (D > 3) {
      return x.template tail<D - 1>().norm();
    } else {
      // by components: if components were just stored, a vector load of them stalls
      using std::sqrt;  // or that of Real
      return sqrt(x[1] * x[1] + x[2] * x[2]);
    }
  }

  [[nodiscard]] Vec modified(const Vec& u) const {
    Vec result;
    result[0] = u[0] + mu_ * tangential_norm(u);
    for (int k = 1; k < D; ++k) result[k] = u[k];
    return result;
  }

  [[nodiscard]] Vec project(const Vec& x) const {
    const Real norm = tangential_norm(x);
    if (x[0] >= 0 && norm <= mu_ * x[0]) return x;  // mu = 0: a ray, not a line
    if (mu_ * norm <= -x[0]) return Vec::Zero();
    Vec result;
    result[0] = (x[0] + mu_ * norm) / (1 + mu_ * mu_);
    const Real scale = norm > 0 ? mu_ * result[0] / norm : Real(0);
    for (int k = 1; k < D; ++k) result[k] = scale * x[k];
    return result;
  }

  /// With T = ||y_T|| - s for y_T = r_T - rho u_T and s = rho ||u_T||, a = r_N - rho u_N and
  /// g = T - mu a, which is what is left of the law of sliding,
  ///
  ///   F = r                                            if a + mu T <= 0         (open)
  ///   F = rho (u_N + mu ||u_T||, u_T)                  if ||y_T|| <= mu (a - mu s)  (stick)
  ///   F_N = rho u_N - mu g / (1 + mu^2)                else                     (slide)
  ///   F_T = rho u_T + (s + g / (1 + mu^2)) y_T / ||y_T||
  [[nodiscard]] NaturalPoint<Vec> natural(const Vec& u, const Vec& r, Real rho,
                                          const Slack& slack) const {
    Vec y;
    Vec map;
    for (int k = 0; k < D; ++k) {
      map[k] = rho * u[k];
      y[k] = r[k] - map[k];
    }
    const Real norm = tangential_norm(y);
    const Real slip = rho * above_slack(tangential_norm(u), slack[0]);
    const Real left = norm - slip;
    if (y[0] + mu_ * left <= 0) return {r, ContactStatus::open};
    const Real pressed = y[0] - mu_ * slip;
    if (pressed >= 0 && norm <= mu_ * pressed) {
      map[0] += mu_ * slip;
      return {map, ContactStatus::stick};
    }
    const Real length = (left - mu_ * y[0]) / (1 + mu_ * mu_);
    map[0] -= mu_ * length;
    const Real scale = norm == 0 ? Real(0) : (slip + length) / norm;
    for (int k = 1; k < D; ++k) map[k] += scale * y[k];
    return {map, ContactStatus::slide};
  }

 private:
  Real mu_;
};

}  // namespace fclib
