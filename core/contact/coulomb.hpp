// The Coulomb cone K = { ||r_T|| <= mu r_N } of one contact, in d = 2 or 3 dimensions.
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
  static constexpr int groups = 1;          // of tangential components with a limit each
  static constexpr int group_size = D - 1;  // components of a group
  using Vec = ContactVector<D, Real>;

  explicit Coulomb(Real mu) : mu_(mu) {}
  Coulomb(const Friction& friction, Eigen::Index contact) : mu_(friction.mu[contact]) {}

  [[nodiscard]] Real mu() const { return mu_; }
  /// Of a group: ||r_group|| <= coefficient r_N.
  [[nodiscard]] Real coefficient(int /*group*/) const { return mu_; }

  /// ||x_T||
  static Real tangential_norm(const Vec& x) {
    if constexpr (D == 2) {
      using std::abs;  // or that of Real
      return abs(x[1]);
    } else {
      // by components: vector loads of what was just stored by components stall
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

  [[nodiscard]] Vec outside(const Vec& x) const {
    const Real norm = tangential_norm(x);
    const Real beyond = norm - mu_ * x[0];
    if (x[0] >= 0 && beyond <= 0) return Vec::Zero();
    if (mu_ * norm <= -x[0]) return x;
    const Real length = beyond / (1 + mu_ * mu_);
    Vec result;
    result[0] = -mu_ * length;
    for (int k = 1; k < D; ++k) result[k] = length / norm * x[k];
    return result;
  }

 private:
  Real mu_;
};

}  // namespace fclib
