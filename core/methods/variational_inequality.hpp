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

#include <array>
#include <string_view>

#include "contact/cones.hpp"
#include "reduced/reduced_problem.hpp"

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
    "What a step is relative to. contact: the mean diagonal of the contact's own W_aa. uniform: "
    "the largest of all, as in the paper.";

template <class Cone>
class VariationalInequality {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;

  VariationalInequality(const ReducedProblem& problem, Metric metric);

  /// A point to work on, r in its place and all else unset.
  [[nodiscard]] VelocityPoint point(const Vector& r) const;

  /// F(r) from r, the one product with W.
  void evaluate(VelocityPoint& at) const;

  /// F(r) from r and u.
  void modify(VelocityPoint& at) const;

  /// to.r = P_K(from - rho w direction).
  void project(const Vector& from, double rho, const Vector& direction, VelocityPoint& to) const;

  /// The natural map at the point, relative as every tolerance; at least what W r rounds, where
  /// reactions have grown so large that this is what is left of u.
  [[nodiscard]] double error(const VelocityPoint& at) const;

  /// Of the two points; 0 where they are the same.
  [[nodiscard]] double ratio(StepRatio which, const VelocityPoint& a, const VelocityPoint& b) const;

  /// ||a - b||^2 in the metric.
  [[nodiscard]] double distance_squared(const Vector& a, const Vector& b) const;

  /// ||f||^2 of a velocity, in the dual metric.
  [[nodiscard]] double velocity_squared(const Vector& f) const;

  /// The largest eigenvalue of W in the metric, from below, by the power method; 1 where W = 0.
  [[nodiscard]] double largest_eigenvalue() const;

 private:
  static constexpr double tiny = 1e-14;
  static constexpr double swamped = 0.1;  // share of q that rounding may take

  [[nodiscard]] Cone cone(Index a) const { return Cone(problem_.friction, a); }

  const ReducedProblem& problem_;
  Vector weight_;                // w (nc)
  double largest_diagonal_ = 0;  // of the mean diagonals of the W_aa
};

#define FCLIB_DECLARE(Cone) extern template class VariationalInequality<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
