// The cone of a contact that resists spin, the turning about its normal, beside sliding:
//
//   K = { ||r_T|| <= mu r_N, |r_S| <= mu_s r_N, ||r_R|| <= mu_r r_N }
//   u^ = u + [mu ||u_T|| + mu_s |u_S| + mu_r ||u_R||, 0, ...]
//
// with components N, T1, T2, S (dim 4), and R1, R2 (dim 6) if it resists rolling too. r_S is the
// moment about the normal, u_S the relative spin. The term in u^ is the support function of the
// section r_N = 1 of K, which makes the law of maximal dissipation a complementarity between K and
// its dual: docs/mathematics.md.
//
// de Saxce & Feng, "The bipotential method" (1998); Leine & Glocker, "A set-valued force law for
// spatial Coulomb-Contensou friction" (2003).
#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "contact/cone.hpp"

namespace fclib {

/// The cone of groups of components, each with a limit of its own: ||r_g|| <= mu_g r_N.
template <class Real, int... sizes>
class Product {
 public:
  static constexpr int dim = 1 + (sizes + ...);
  static constexpr int groups = sizeof...(sizes);
  static constexpr int lengths = 3;  // N and T are lengths, see Friction
  /// Components of a group, and the first of them.
  static constexpr int size(int group) { return std::array{sizes...}[group]; }
  static constexpr int start(int group) {
    int first = 1;
    for (int g = 0; g < group; ++g) first += size(g);
    return first;
  }
  using Vec = ContactVector<dim, Real>;
  using Slack = std::array<Real, groups>;
  using Norms = std::array<Real, groups>;

  explicit Product(const std::array<Real, groups>& coefficients) : mu_(coefficients) {}

  /// The limit of a group is ||r_group|| <= coefficient r_N.
  [[nodiscard]] Real coefficient(int group) const { return mu_[group]; }

  [[nodiscard]] Vec modified(const Vec& u) const {
    Vec result = u;
    const Norms norms = norms_of(u);
    for (int g = 0; g < groups; ++g) result[0] += mu_[g] * norms[g];
    return result;
  }

  /// The normal part n of the projection is the root of this increasing function:
  ///   n - x_N - sum mu_g max(0, ||x_g|| - mu_g n)
  /// It is linear between the values of n at which a limit stops binding.
  [[nodiscard]] Vec project(const Vec& x) const {
    const Norms norms = norms_of(x);
    if (within(norms, x[0])) return x;
    Real beyond = x[0];
    for (int g = 0; g < groups; ++g) beyond += mu_[g] * norms[g];
    if (beyond <= 0) return Vec::Zero();
    std::array<bool, groups> binds{};
    Real sum = x[0];
    Real weight = 1;
    Real n = x[0];
    for (const int g : by_length(norms)) {
      if (!(norms[g] > mu_[g] * n)) break;  // nor does any other
      binds[g] = true;
      sum += mu_[g] * norms[g];
      weight += mu_[g] * mu_[g];
      n = sum / weight;
    }
    if (n < 0) n = 0;  // by rounding, on the border of the polar cone
    Vec result = x;
    result[0] = n;
    scale(result,
          [&](int g) { return binds[g] && norms[g] > 0 ? mu_[g] * n / norms[g] : Real(1); });
    return result;
  }

  /// The projection of y = r - rho u^ cuts ||y_g|| by c_g, so that with s_g = rho ||u_g||
  ///
  ///   F_N = rho u_N + sum mu_g (s_g - c_g),   F_g = rho u_g + c_g y_g / ||y_g||
  ///
  /// and its normal part is n = a + sum mu_g (c_g - s_g), a = r_N - rho u_N. If a limit binds, c_g
  /// =
  /// ||y_g|| - mu_g n > 0; else c_g = 0. The large parts, mu_g s_g, cancel in these sums before
  /// they are formed.
  [[nodiscard]] NaturalPoint<Vec> natural(const Vec& u, const Vec& r, Real rho,
                                          const Slack& slack) const {
    Vec map = rho * u;
    const Vec y = r - map;
    const Real a = y[0];
    const Norms norms = norms_of(y);
    Norms slip = norms_of(u);
    Norms left;
    Real all = a;
    Real idle = 0;  // sum mu_g s_g of the groups that are not cut
    for (int g = 0; g < groups; ++g) {
      slip[g] = rho * above_slack(slip[g], slack[g]);
      left[g] = norms[g] - slip[g];
      all += mu_[g] * left[g];
      idle += mu_[g] * slip[g];
    }
    if (all <= 0) return {r, ContactStatus::open};
    if (within(norms, a - idle)) {
      map[0] += idle;
      return {map, ContactStatus::stick};
    }
    std::array<bool, groups> binds{};
    Real sum = a;
    Real weight = 1;
    bool first = true;
    for (const int g : by_length(norms)) {
      if (!first && !(norms[g] * weight > mu_[g] * (sum - idle))) break;
      first = false;
      binds[g] = true;
      sum += mu_[g] * left[g];
      weight += mu_[g] * mu_[g];
      idle = 0;
      for (int h = 0; h < groups; ++h) {
        if (!binds[h]) idle += mu_[h] * slip[h];
      }
    }
    Real fall = -idle;  // weight (n - a)
    std::array<Real, groups> cut{};
    for (int g = 0; g < groups; ++g) {
      if (!binds[g]) continue;
      const Real beyond = left[g] - mu_[g] * a;
      fall += mu_[g] * beyond;
      Real turn = mu_[g] * idle;
      for (int h = 0; h < groups; ++h) {
        if (binds[h] && h != g) turn += mu_[h] * (mu_[h] * left[g] - mu_[g] * left[h]);
      }
      cut[g] = slip[g] + (beyond + turn) / weight;
    }
    map[0] -= fall / weight;
    // if a cut is NaN, the result must show it
    for_each_group<Product>([&](auto group) {
      constexpr int g = group;
      if (!(cut[g] <= 0) && norms[g] != 0) {
        map.template segment<size(g)>(start(g)) +=
            cut[g] / norms[g] * y.template segment<size(g)>(start(g));
      }
    });
    return {map, ContactStatus::slide};
  }

 private:
  static Norms norms_of(const Vec& x) {
    Norms result;
    for_each_group<Product>([&](auto group) {
      constexpr int g = group;
      result[g] = x.template segment<size(g)>(start(g)).norm();
    });
    return result;
  }

  template <class Factor>
  static void scale(Vec& x, const Factor& factor) {
    for_each_group<Product>([&](auto group) {
      constexpr int g = group;
      x.template segment<size(g)>(start(g)) *= factor(g);
    });
  }

  [[nodiscard]] bool within(const Norms& norms, Real normal) const {
    if (!(normal >= 0)) return false;
    for (int g = 0; g < groups; ++g) {
      if (!(norms[g] <= mu_[g] * normal)) return false;
    }
    return true;
  }

  /// The groups, those first whose limit binds up to a larger normal part.
  [[nodiscard]] std::array<int, groups> by_length(const Norms& norms) const {
    std::array<int, groups> order;
    std::array<bool, groups> always;
    Norms reach;
    for (int g = 0; g < groups; ++g) {
      order[g] = g;
      always[g] = norms[g] > 0 && !(mu_[g] > 0);
      reach[g] = norms[g] > 0 && mu_[g] > 0 ? norms[g] / mu_[g] : Real(0);
    }
    std::sort(order.begin(), order.end(), [&](int g, int h) {
      if (always[g] != always[h]) return always[g];
      return reach[g] != reach[h] ? reach[g] > reach[h] : g < h;
    });
    return order;
  }

  std::array<Real, groups> mu_;
};

template <int D, class Real = double>
class Spin : public std::conditional_t<D == 4, Product<Real, 2, 1>, Product<Real, 2, 1, 2>> {
  static_assert(D == 4 || D == 6);

 public:
  using Base = std::conditional_t<D == 4, Product<Real, 2, 1>, Product<Real, 2, 1, 2>>;
  using Coefficients = std::array<Real, Base::groups>;

  explicit Spin(const Coefficients& coefficients) : Base(coefficients) {}
  Spin(const Friction& friction, Eigen::Index contact) : Base(of(friction, contact)) {}

 private:
  static Coefficients of(const Friction& friction, Eigen::Index contact) {
    Coefficients result;
    result[0] = friction.mu[contact];
    result[1] = friction.mu_s[contact];
    if constexpr (D == 6) result[2] = friction.mu_r[contact];
    return result;
  }
};

// with other numbers they are compiled where they are used
extern template class Product<double, 2, 1>;
extern template class Product<double, 2, 1, 2>;

}  // namespace fclib
