// The convex sets of the subproblems with a fixed shift, or with a fixed threshold:
//
//   Cones       r in K
//   Cylinders   r_N >= 0, ||r_T|| <= g (and so for each other group); the normal or the tangential
//   part may
//               be held fixed
//
// A set offers the Euclidean projection for contact a, `project(a, x, now)`: `now` has the parts
// that are held fixed. It also offers `minimise`, which improves r^a for 1/2 r.A r + b.r over the
// set.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "contact/cone.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

/// The largest row sum of the symmetric part. It is at least the largest eigenvalue. N = 1 to 6.
template <int N>
double curvature_bound(const ContactMatrix<N>& a);

/// What `minimise` needs of a diagonal block: upper bounds of its curvature.
template <class Cone>
struct ContactCurvature {
  ContactMatrix<Cone::dim> block;
  double whole = 0;                           // of the block
  std::array<double, Cone::groups> groups{};  // of each tangential group

  explicit ContactCurvature(const ContactMatrix<Cone::dim>& a)
      : block(a), whole(curvature_bound<Cone::dim>(a)) {
    for_each_group<Cone>([&](auto g) {
      constexpr int at = Cone::start(g);
      constexpr int size = Cone::size(g);
      groups[g] = curvature_bound<size>(a.template block<size, size>(at, at));
    });
  }
};

template <class ConeType>
class Cones {
 public:
  using Cone = ConeType;
  using Vec = typename Cone::Vec;

  explicit Cones(const Friction& friction) : friction_(friction) {}

  [[nodiscard]] Vec project(Index a, const Vec& x, const Vec& /*now*/) const {
    return Cone(friction_, a).project(x);
  }

  void minimise(Index a, const ContactCurvature<Cone>& c, const Vec& b, int steps, Vec& r) const {
    if (!(c.whole > 0)) return;
    const Cone cone(friction_, a);
    Vec y = r;
    double theta = 1;
    for (int k = 0; k < steps; ++k) {
      const Vec slope = c.block * y + b;
      const Vec next = cone.project(y - slope / c.whole);
      const Vec change = next - r;
      const bool converged = change.squaredNorm() <= 1e-12 * next.squaredNorm();
      const double grown = 0.5 * (1 + std::sqrt(1 + 4 * theta * theta));
      const bool restart = slope.dot(change) > 0;
      y = restart ? next : Vec(next + ((theta - 1) / grown) * change);
      theta = restart ? 1 : grown;
      r = next;
      if (converged) return;
    }
  }

 private:
  const Friction& friction_;
};

template <class ConeType>
class Cylinders {
 public:
  using Cone = ConeType;
  using Vec = typename Cone::Vec;

  bool normal = true;      ///< r_N may change
  bool tangential = true;  ///< r_T may change

  explicit Cylinders(const Friction& friction)
      : friction_(friction), radius_(Vector::Zero(Cone::groups * friction.mu.size())) {}

  /// Sets the thresholds of friction from r, or makes a step towards them.
  void set_thresholds(const Vector& r, double relaxation = 1) {
    for (Eigen::Index a = 0; a < friction_.mu.size(); ++a) {
      const Cone cone(friction_, a);
      for (int g = 0; g < Cone::groups; ++g) {
        double& radius = radius_[Cone::groups * a + g];
        radius += relaxation * (cone.coefficient(g) * std::max(0.0, r[Cone::dim * a]) - radius);
      }
    }
  }

  [[nodiscard]] Vec project(Index a, const Vec& x, const Vec& now) const {
    Vec result = now;
    if (normal) result[0] = std::max(0.0, x[0]);
    if (!tangential) return result;
    for_each_group<Cone>([&](auto g) {
      constexpr int at = Cone::start(g);
      constexpr int size = Cone::size(g);
      auto part = result.template segment<size>(at);
      part = x.template segment<size>(at);
      limit(radius_[Cone::groups * a + g], part);
    });
    return result;
  }

  void minimise(Index a, const ContactCurvature<Cone>& c, const Vec& b, int steps, Vec& r) const {
    for (int k = 0; k < steps; ++k) {
      const Vec old = r;
      if (normal && c.block(0, 0) > 0) {
        r[0] = std::max(0.0, r[0] - (b[0] + c.block.row(0).dot(r)) / c.block(0, 0));
      }
      for_each_group<Cone>([&](auto g) {
        const double curvature = c.groups[g];
        if (!tangential || !(curvature > 0)) return;
        constexpr int at = Cone::start(g);
        constexpr int size = Cone::size(g);
        auto part = r.template segment<size>(at);
        part -= (b.template segment<size>(at) + c.block.template middleRows<size>(at) * r).eval() /
                curvature;
        limit(radius_[Cone::groups * a + g], part);
      });
      if ((r - old).squaredNorm() <= 1e-12 * r.squaredNorm()) return;
    }
  }

 private:
  template <class Part>
  static void limit(double radius, Part&& part) {
    const double norm = part.norm();
    if (norm > radius) part *= radius / norm;
  }

  const Friction& friction_;
  Vector radius_;  // (groups nc)
};

}  // namespace fclib
