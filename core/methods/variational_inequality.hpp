// The contact problem as a variational inequality over the product of the cones: find r in K with
//
//   F(r) . (s - r) >= 0 for all s in K,   F(r) = u^,  u = W r + q
//
// Acary, Bremond, Huber, "On solving contact problems with Coulomb friction: formulations and
// numerical comparisons" (2018), section 3.
//
// Distances are measured in a metric with one weight w^a > 0 for each contact, ||s||^2 = sum
// |s^a|^2 / w^a. In this metric the projection on K does not change: P_K(r - rho w F). With weights
// 1 / W_aa the methods do not depend on the scale of each contact.
#pragma once

#include <array>
#include <string_view>

#include "contact/cones.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

/// r, and what follows from it.
struct VelocityPoint {
  Vector r;
  Vector u;    ///< W r + q
  Vector hat;  ///< F(r) = u^
};

/// The ratio that tells whether a step is too long, in the metric.
enum class StepRatio {
  khobotov,       ///< ||F(a) - F(b)|| / ||a - b||
  solodov_tseng,  ///< (a - b) . (F(a) - F(b)) / ||a - b||^2
};

enum class Metric { contact, uniform };
inline constexpr std::array<std::string_view, 2> metrics{"contact", "uniform"};
inline constexpr std::string_view metric_doc =
    "What a step is relative to. contact: the mean diagonal of the contact's own W_aa. uniform: "
    "the largest of all, as in the paper.";

template <class Cone>
class VariationalInequality {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;

  VariationalInequality(const ReducedProblem& problem, Metric metric);

  /// A point with r; all the rest is unset.
  [[nodiscard]] VelocityPoint point(const Vector& r) const;

  /// F(r) from r, by one product with W.
  void evaluate(VelocityPoint& at) const;

  /// F(r) from r and u.
  void modify(VelocityPoint& at) const;

  /// to.r = P_K(from - rho w direction).
  void project(const Vector& from, double rho, const Vector& direction, VelocityPoint& to) const;

  /// The natural map at the point, relative as for every tolerance. If reactions have grown so
  /// large that only the rounding of W r is left of u, it is at least that rounding.
  [[nodiscard]] double error(const VelocityPoint& at) const;

  /// The ratio of the two points. 0 if they are equal.
  [[nodiscard]] double ratio(StepRatio which, const VelocityPoint& a, const VelocityPoint& b) const;

  /// ||a - b||^2 in the metric.
  [[nodiscard]] double distance_squared(const Vector& a, const Vector& b) const;

  /// ||f||^2 of a velocity, in the dual metric.
  [[nodiscard]] double velocity_squared(const Vector& f) const;

  /// A lower bound of the largest eigenvalue of W in the metric, by the power method. 1 if W = 0.
  [[nodiscard]] double largest_eigenvalue() const;

 private:
  static constexpr double tiny = 1e-14;
  static constexpr double swamped = 0.1;  // share of q that rounding may take

  [[nodiscard]] Cone cone(Index a) const { return Cone(problem_.friction, a); }

  const ReducedProblem& problem_;
  Vector weight_;                // w (nc)
  double largest_diagonal_ = 0;  // the largest of the mean diagonals of the W_aa
};

#define FCLIB_DECLARE(Cone) extern template class VariationalInequality<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
