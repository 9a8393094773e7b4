// The cone of a contact whose sliding and spin share one limit, with components N, T1, T2, S:
//
//   K = { (||r_T|| / mu)^2 + (r_S / mu_s)^2 <= r_N^2, r_N >= 0 }
//   u^ = u + [sqrt((mu ||u_T||)^2 + (mu_s u_S)^2), 0, 0, 0]
//
// If a coefficient is 0, the component is 0. The patch of a contact couples the two alike
// (docs/mathematics.md). Solvers see it as a round cone: reduced/round.hpp.
//
// Goyal, Ruina & Papadopoulos, "Planar sliding with dry friction" (1991); Howe & Cutkosky,
// "Practical force-motion models for sliding manipulation" (1996).
#pragma once

#include <cmath>

#include "contact/cone.hpp"

namespace fclib {

template <class Real = double>
class Ellipsoid {
 public:
  static constexpr int dim = 4;
  static constexpr int groups = 2;  // T and S, which share a limit
  static constexpr int start(int group) { return group == 0 ? 1 : 3; }
  static constexpr int size(int group) { return group == 0 ? 2 : 1; }
  using Vec = ContactVector<dim, Real>;
  using Slack = std::array<Real, groups>;

  Ellipsoid(Real mu, Real mu_s) : mu_{mu, mu_s} {}
  Ellipsoid(const Friction& friction, Eigen::Index contact)
      : mu_{Real(friction.mu[contact]), Real(friction.mu_s[contact])} {}

  [[nodiscard]] Real coefficient(int group) const { return mu_[group]; }

  [[nodiscard]] Vec modified(const Vec& u) const {
    Vec result = u;
    result[0] += scaled(u).norm();
    return result;
  }

  [[nodiscard]] Vec project(const Vec& x) const {
    if (inside(x, x[0])) return borne(x);
    const Tangent image = scaled(x);
    const Real length = image.norm();
    if (x[0] + length <= 0) return Vec::Zero();
    const Sizes sizes = sizes_of(image);
    const Normal normal = normal_part(x[0], Real(0), length, sizes);
    Vec result;
    result[0] = normal.n;
    for (int k = 1; k < dim; ++k) {
      const int g = k == 3;
      const Real part = mu_[g] * mu_[g] * normal.n;
      result[k] = sizes[g] > 0 ? part / (normal.d + part) * x[k] : Real(0);
    }
    return result;
  }

  /// With E = diag(mu, mu, mu_s), y_t = r_t - rho u_t of the three tangential components, s = rho
  /// ||E u_t||, a = r_N - rho u_N and n = a + d the normal part of the projection of y = r - rho
  /// u^,
  ///
  ///   F = r                                                  if a + ||E y_t|| - s <= 0      (open)
  ///   F = rho (u_N + ||E u_t||, u_t)                          if y is in K (stick) F_N = rho u_N -
  ///   d                                       else                           (slide) F_k = rho u_k
  ///   + (s + d) y_k / (s + d + e_k^2 n)
  ///
  /// The large parts, s and ||E y_t||, are not subtracted from each other.
  [[nodiscard]] NaturalPoint<Vec> natural(const Vec& u, const Vec& r, Real rho,
                                          const Slack& slack) const {
    Vec map = rho * u;
    const Vec y = r - map;
    const Real a = y[0];
    const Tangent image = scaled(y);
    Tangent slip = scaled(map);
    if (map.template segment<2>(1).norm() <= rho * slack[0]) slip[0] = slip[1] = Real(0);
    using std::abs;  // or that of Real
    if (abs(map[3]) <= rho * slack[1]) slip[2] = Real(0);
    const Real s = slip.norm();
    const Real length = image.norm();
    // ||E y_t|| - s = (image - slip).(image + slip) / (...), and image + slip is E r_t
    Tangent sum = scaled(r);
    for (int k = 0; k < 3; ++k) {
      if (slip[k] == 0) sum[k] = image[k];
    }
    const Real both = length + s;
    const Real left = both > 0 ? sum.dot(image - slip) / both : Real(0);
    if (a + left <= 0) return {r, ContactStatus::open};
    if (inside(y, a - s)) {
      map[0] += s;
      bool sticks = true;
      for (int k = 1; k < dim; ++k) {
        if (mu_[k == 3] > 0) continue;
        map[k] = r[k];
        sticks = sticks && y[k] == 0;
      }
      return {map, sticks ? ContactStatus::stick : ContactStatus::slide};
    }
    const Sizes sizes = sizes_of(image);
    const Normal normal = normal_part(a, s, left, sizes);
    const Real rest = s + normal.d;
    map[0] -= normal.d;
    for (int k = 1; k < dim; ++k) {
      const int g = k == 3;
      if (!(mu_[g] > 0)) {
        map[k] = r[k];
      } else if (sizes[g] != 0) {  // if it is NaN, the result must show it
        map[k] += rest / (rest + mu_[g] * mu_[g] * normal.n) * y[k];
      }
    }
    return {map, ContactStatus::slide};
  }

 private:
  using Tangent = ContactVector<3, Real>;
  using Sizes = std::array<Real, groups>;

  /// E x_t
  [[nodiscard]] Tangent scaled(const Vec& x) const {
    return {mu_[0] * x[1], mu_[0] * x[2], mu_[1] * x[3]};
  }

  static Sizes sizes_of(const Tangent& image) {
    using std::abs;  // or that of Real
    return {image.template head<2>().norm(), abs(image[2])};
  }

  /// x without the components that K does not bear.
  [[nodiscard]] Vec borne(Vec x) const {
    for (int k = 1; k < dim; ++k) {
      if (!(mu_[k == 3] > 0)) x[k] = Real(0);
    }
    return x;
  }

  /// Whether what K bears of x_t fits into its section at a normal part.
  [[nodiscard]] bool inside(const Vec& x, Real normal) const {
    if (!(normal >= 0)) return false;
    Real square = 0;
    for (int k = 1; k < dim; ++k) {
      const int g = k == 3;
      if (mu_[g] > 0) square += (x[k] / mu_[g]) * (x[k] / mu_[g]);
    }
    using std::sqrt;  // or that of Real
    return sqrt(square) <= normal;
  }

  /// The normal part n of a projection, and d = n - a, each without cancellation.
  struct Normal {
    Real n, d;
  };

  /// The root of sum (sizes_g / (s + k_g))^2 = 1 with k_g = d + e_g^2 n, if the root of the sum of
  /// the squares of `sizes` is s + left. As (s + left)^2 is that sum too, the sum less 1 is
  ///
  ///   sum (sizes_g / (s + k_g))^2 (left - k_g) (2 s + left + k_g) / (s + left)^2
  ///
  /// which has no large parts that cancel. 1 over the root of the sum is a concave and increasing
  /// function of n, so Newton's method on it finds the root from below.
  [[nodiscard]] Normal normal_part(Real a, Real s, Real left, const Sizes& sizes) const {
    constexpr int most = 60;
    const Real length = s + left;
    bool any = false;
    Normal low{};   // the least of the roots of k_g = left
    Normal high{};  // the largest of those of s + k_g = sizes_g
    for (int g = 0; g < groups; ++g) {
      if (!(sizes[g] > 0)) continue;
      const Real square = mu_[g] * mu_[g];
      const Real weight = 1 + square;
      const Real own = sizes[g] - s;
      const Normal one{(a + left) / weight, (left - square * a) / weight};
      const Normal other{(a + own) / weight, (own - square * a) / weight};
      if (!any || one.n < low.n) low = one;
      if (!any || other.n > high.n) high = other;
      any = true;
    }
    if (!any) return {a - s, -s};
    Normal at = low.n < high.n ? high : low;
    using std::sqrt;  // or that of Real
    for (int step = 0; step < most; ++step) {
      Real sum = 0;
      Real beyond = 0;
      Real slope = 0;
      for (int g = 0; g < groups; ++g) {
        if (!(sizes[g] > 0)) continue;
        const Real square = mu_[g] * mu_[g];
        const Real k = at.d + square * at.n;
        const Real share = sizes[g] / (s + k) * (sizes[g] / (s + k));
        sum += share;
        beyond += share * (left - k) * (2 * s + left + k);
        slope += share * (1 + square) / (s + k);
      }
      const Real change = beyond / (length * length) * sum / ((1 + sqrt(sum)) * slope);
      const Normal next{at.n + change, at.d + change};
      if (next.n == at.n && next.d == at.d) break;
      at = next;
    }
    return at;
  }

  std::array<Real, groups> mu_;
};

}  // namespace fclib
