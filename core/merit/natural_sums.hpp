// The natural map of a whole solution, plain and scaled, summed up contact by contact: the part of
// the merit that every formulation shares.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "contact/cone.hpp"

namespace fclib {

/// rho of each contact: 1 over its size, the mean |W_kk| of its block. A contact that has none
/// takes part with the mean of the others, so that no units decide what it weighs beside them.
template <class Real>
class ContactScales {
 public:
  void add(Real size) {
    if (size > 0) mean_ += (size - mean_) / Real(static_cast<double>(++count_));
  }
  [[nodiscard]] Real rho(Real size) const {
    if (size > 0) return 1 / size;
    return count_ > 0 ? 1 / mean_ : Real(1);
  }

 private:
  Real mean_ = 0;
  std::int64_t count_ = 0;
};

/// In the precision of Cone.
template <class Cone>
class NaturalSums {
 public:
  using Vec = typename Cone::Vec;
  using Real = typename Vec::Scalar;

  /// Adds a contact with normal velocity u_N, modified velocity u^ and reaction r, ||q^a||^2, what
  /// rounding leaves of q^a, and rho as ContactScales has it. The norm of its natural map.
  Real add(const Cone& cone, Real normal, const Vec& modified, const Vec& r, Real q_square,
           Real rounding, Real rho) {
    const OfModified known{cone};
    const Real norm = natural_map(known, modified, r).norm();
    squares_ += square_beyond(norm, rounding);
    q_squares_ += q_square;
    const Real scaled = natural_map(known, modified, r, rho).norm();
    scaled_squares_ += square_beyond(scaled, rho * rounding);
    velocity_squares_ += square_beyond(std::max(scaled / rho, -normal), rounding);
    scaled_q_ += rho * rho * q_square;
    if (rounding != 0) {
      rounding_squares_ += rounding * rounding;
      scaled_rounding_ += rho * rho * rounding * rounding;
    }
    return norm;
  }

  [[nodiscard]] double natural() const { return relative(squares_, q_squares_, rounding_squares_); }
  /// The larger of the scaled one summed as impulses and as velocities (contact/natural_squares).
  [[nodiscard]] double scaled_natural() const {
    return std::max(relative(scaled_squares_, scaled_q_, scaled_rounding_),
                    relative(velocity_squares_, q_squares_, rounding_squares_));
  }

 private:
  /// The cone, to which velocities come modified: two maps share the one u^.
  struct OfModified {
    using Vec = typename Cone::Vec;
    const Cone& cone;

    [[nodiscard]] const Vec& modified(const Vec& u) const { return u; }
    [[nodiscard]] Vec outside(const Vec& x) const { return cone.outside(x); }
  };

  /// The natural map of a contact beyond what the rounding of its q explains.
  static Real square_beyond(Real norm, Real rounding) {
    const Real left = norm - rounding;
    return left < 0 ? Real(0) : left * left;
  }

  /// ||F|| over ||q||, or over what rounding leaves of q where that is larger; absolute without
  /// either.
  static double relative(Real squares, Real q_squares, Real rounding_squares) {
    using std::sqrt;  // or that of Real
    const Real scale = sqrt(std::max(q_squares, rounding_squares));
    const Real norm = sqrt(squares);
    return static_cast<double>(scale > 0 ? norm / scale : norm);
  }

  Real squares_ = 0;
  Real q_squares_ = 0;
  Real rounding_squares_ = 0;
  Real scaled_squares_ = 0;
  Real velocity_squares_ = 0;
  Real scaled_q_ = 0;
  Real scaled_rounding_ = 0;
};

}  // namespace fclib
