// A problem in the units of its own contacts, for methods whose path from a distant start depends
// on units.
//
//   r~ = S r / size,  u~ = S^-1 u / size,  W~ = S^-1 W S^-1,  q~ = S^-1 q / size
//
// S is diagonal. Its entries are the root of the mean diagonal of W_aa over the normal and the
// tangential part, and of that over the parts of spin and rolling. So masses may differ from
// contact to contact, and lengths may stand beside angles. A cone stays one of its kind, with mu_r~
// = mu_r s_R / s_N and mu_s~ alike, and r~ . u~ is r . u / size^2. ||q~||_inf is 1.
#pragma once

#include "reduced/reduced_problem.hpp"

namespace fclib {

/// Share of the largest W_aa. If joints hold a contact, what they leave of it is rounding below
/// this.
inline constexpr double nothing_moves = 1e-14;

class OwnUnits {
 public:
  explicit OwnUnits(const ReducedProblem& problem);

  /// The friction, with mu_r~ and mu_s~ in the places of mu_r and mu_s.
  [[nodiscard]] const Friction& friction() const { return friction_; }
  /// q~ (m).
  [[nodiscard]] const Vector& q() const { return q_; }

  /// S (m) and S^-1.
  [[nodiscard]] const Vector& unit() const { return unit_; }
  [[nodiscard]] const Vector& inverse() const { return inverse_; }

  /// r~ of r (m), and u~ of u.
  [[nodiscard]] Vector to_own(const Vector& r) const { return r.cwiseProduct(unit_) / size_; }
  [[nodiscard]] Vector to_own_velocities(const Vector& u) const {
    return u.cwiseProduct(inverse_) / size_;
  }
  /// r of r~, and u of u~ (m).
  [[nodiscard]] Vector reactions(const Vector& r) const { return size_ * r.cwiseProduct(inverse_); }
  [[nodiscard]] Vector velocities(const Vector& u) const { return size_ * u.cwiseProduct(unit_); }

  /// y = W~ r + b.
  void product(const Vector& r, const Vector& b, Vector& y, Workers* workers = nullptr) const;

  /// Turns a block D_a (d x d) of a system for r~, (I + D W~) x~ = b~, into the block of the system
  /// for r, (I + D W) x = b.
  template <int d>
  [[nodiscard]] Eigen::Matrix<double, d, d> block(Index a,
                                                  const Eigen::Matrix<double, d, d>& own) const {
    const auto scale = inverse_.segment<d>(Eigen::Index{d} * a).asDiagonal();
    return scale * own * scale;
  }
  /// S^-1 b: the right side of that system for r, given the one for r~.
  [[nodiscard]] Vector divided(const Vector& b) const { return b.cwiseProduct(inverse_); }
  /// S x: the solution for r~, given the one for r.
  [[nodiscard]] Vector multiplied(const Vector& x) const { return x.cwiseProduct(unit_); }

 private:
  const ReducedProblem& problem_;
  Vector unit_, inverse_;  // of each component [W^1/2], and 1 over it
  double size_ = 1;
  Friction friction_;
  Vector q_;
};

}  // namespace fclib
