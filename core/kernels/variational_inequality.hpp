// The contact problem as a variational inequality over the product of the cones: find r in K with
//
//   F(r) . (s - r) >= 0 for all s in K,   F(r) = u^,  u = W r + q
//
// Acary, Bremond, Huber, "On solving contact problems with Coulomb friction: formulations and
// numerical comparisons" (2018), section 3.
//
// Distances are measured in a metric of one weight w^a > 0 a contact, ||s||^2 = sum |s^a|^2 / w^a,
// in which the projection on K stays what it is: P_K(r - rho w F). Weights equal to 1 / W_aa make
// the methods blind to the scale of each contact.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

#include "kernels/delassus.hpp"
#include "kernels/natural_error.hpp"

namespace fclib {

/// r, and what belongs to it.
struct VelocityPoint {
  Vector r;
  Vector u;    ///< W r + q
  Vector hat;  ///< F(r) = u^
};

/// What tells whether a step is too long, in the metric.
enum class StepRatio {
  khobotov,       ///< ||F(a) - F(b)|| / ||a - b||
  solodov_tseng,  ///< (a - b) . (F(a) - F(b)) / ||a - b||^2
};

enum class Metric { contact, uniform };
inline constexpr std::array<std::string_view, 2> metrics{"contact", "uniform"};
inline constexpr std::string_view metric_doc =
    "the step of each contact is relative to the mean diagonal of its own W_aa (contact), or of "
    "the largest of all (uniform, as in the paper)";

template <class Cone>
class VariationalInequality {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;

  VariationalInequality(const Delassus& problem, Metric metric)
      : problem_(problem), weight_(problem.nc()) {
    for (Index a = 0; a < problem.nc(); ++a) {
      weight_[a] = problem.W.template diagonal_block<D>(a).trace() / D;
    }
    const double largest = problem.nc() > 0 ? weight_.maxCoeff() : 0.0;
    for (double& w : weight_) {
      if (metric == Metric::uniform || !(w > tiny * largest)) w = largest;
      w = w > 0 ? 1 / w : 1.0;
    }
    largest_diagonal_ = largest;
  }

  /// A point to work on, r in its place and all else unset.
  [[nodiscard]] VelocityPoint point(const Vector& r) const {
    return {r, Vector::Zero(r.size()), Vector::Zero(r.size())};
  }

  /// F(r) from r, the one product with W.
  void evaluate(VelocityPoint& at) const {
    problem_.W.multiply_add(at.r, problem_.q, at.u);
    modify(at);
  }

  /// F(r) from r and u.
  void modify(VelocityPoint& at) const {
    for (Index a = 0; a < problem_.nc(); ++a) {
      at.hat.segment<D>(D * a) = cone(a).modified(at.u.segment<D>(D * a));
    }
  }

  /// to.r = P_K(from - rho w direction).
  void project(const Vector& from, double rho, const Vector& direction, VelocityPoint& to) const {
    for (Index a = 0; a < problem_.nc(); ++a) {
      to.r.segment<D>(D * a) =
          cone(a).project(from.segment<D>(D * a) - rho * weight_[a] * direction.segment<D>(D * a));
    }
  }

  /// The natural map at the point, relative as every tolerance; at least what W r rounds, where
  /// reactions have grown so large that this is what is left of u.
  [[nodiscard]] double error(const VelocityPoint& at) const {
    const double map = std::sqrt(natural_map_squared<Cone>(at.u, at.r, problem_.friction));
    const double rounding =
        std::numeric_limits<double>::epsilon() * largest_diagonal_ * at.r.norm();
    return (rounding > swamped * problem_.scale ? std::max(map, rounding) : map) / problem_.scale;
  }

  /// Of the two points; 0 where they are the same.
  [[nodiscard]] double ratio(StepRatio which, const VelocityPoint& a,
                             const VelocityPoint& b) const {
    double distance = 0;  // ||a - b||^2
    double slope = 0;     // ||F(a) - F(b)||^2
    double product = 0;   // (a - b) . (F(a) - F(b))
    for (Index k = 0; k < problem_.nc(); ++k) {
      const Vec r = a.r.segment<D>(D * k) - b.r.segment<D>(D * k);
      const Vec f = a.hat.segment<D>(D * k) - b.hat.segment<D>(D * k);
      distance += r.squaredNorm() / weight_[k];
      slope += f.squaredNorm() * weight_[k];
      product += r.dot(f);
    }
    if (!(distance > 0)) return 0.0;
    return which == StepRatio::khobotov ? std::sqrt(slope / distance) : product / distance;
  }

  /// ||a - b||^2 in the metric.
  [[nodiscard]] double distance_squared(const Vector& a, const Vector& b) const {
    double sum = 0;
    for (Index k = 0; k < problem_.nc(); ++k) {
      sum += (a - b).template segment<D>(D * k).squaredNorm() / weight_[k];
    }
    return sum;
  }

  /// ||f||^2 of a velocity, in the dual metric.
  [[nodiscard]] double velocity_squared(const Vector& f) const {
    double sum = 0;
    for (Index k = 0; k < problem_.nc(); ++k) {
      sum += f.template segment<D>(D * k).squaredNorm() * weight_[k];
    }
    return sum;
  }

  /// The largest eigenvalue of W in the metric, from below, by the power method; 1 where W = 0.
  [[nodiscard]] double largest_eigenvalue() const {
    constexpr int max_products = 30;
    constexpr double accuracy = 1e-2;
    const Eigen::Index m = problem_.m();
    const Vector zero = Vector::Zero(m);
    Vector x(m);
    Vector y(m);
    // any start with a part along the first eigenvector: no two entries alike
    for (Eigen::Index k = 0; k < m; ++k) x[k] = 1 + 0.5 * std::sin(static_cast<double>(k + 1));
    double value = 0;
    for (int k = 0; k < max_products; ++k) {
      const double norm = std::sqrt(distance_squared(x, zero));
      if (!(norm > 0)) break;
      x /= norm;
      problem_.W.multiply_add(x, zero, y);
      const double last = value;
      value = std::sqrt(velocity_squared(y));
      if (std::abs(value - last) <= accuracy * value) break;
      for (Index a = 0; a < problem_.nc(); ++a) {
        x.segment<D>(D * a) = weight_[a] * y.segment<D>(D * a);
      }
    }
    return value > 0 && std::isfinite(value) ? value : 1.0;
  }

 private:
  static constexpr double tiny = 1e-14;
  static constexpr double swamped = 0.1;  // share of q that rounding may take

  [[nodiscard]] Cone cone(Index a) const { return Cone(problem_.friction, a); }

  const Delassus& problem_;
  Vector weight_;                // w (nc)
  double largest_diagonal_ = 0;  // of the mean diagonals of the W_aa
};

}  // namespace fclib
