// The natural map of a whole solution, plain and scaled, summed over the contacts. Every
// formulation shares this part of the merit.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "contact/cone.hpp"
#include "error_size.hpp"

namespace fclib {

/// rho of each contact is 1 over its size, the mean |W_kk| of its block. A contact without a size
/// gets the mean of the others, so that units do not decide how much it counts beside them.
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

/// The rounding of q, over the sizes of its terms: some roundings. It is less than for v, u and l,
/// since what is allowed to q is hidden from the natural map.
constexpr double rounding_unit_of_q = 4 * std::numeric_limits<double>::epsilon();

/// The last digits of q as a velocity, for a contact with ||q^a|| = `own` among contacts with the
/// root mean square `mean`. Sliding of that speed is no sliding.
template <class Real>
Real slip_of_rounding(Real own, Real mean) {
  return rounding_unit_of_q * (own < mean ? mean : own);
}

/// Sums in the precision of Cone.
template <class Cone>
class NaturalSums {
 public:
  using Vec = typename Cone::Vec;
  using Real = typename Vec::Scalar;

  /// Adds a contact: its velocity u and reaction r, ||q^a||^2, the rounding of q^a, rho as in
  /// ContactScales, and the rounding of the velocities that friction opposes.
  NaturalPoint<Vec> add(const Cone& cone, const Vec& u, const Vec& r, Real q_square, Real rounding,
                        Real rho, const typename Cone::Slack& slack) {
    const NaturalPoint<Vec> plain = cone.natural(u, r, Real(1), slack);
    const NaturalPoint<Vec> scaled = cone.natural(u, r, rho, slack);
    squares_ += square_beyond(plain.map.norm(), rounding);
    q_squares_ += q_square;
    const Real norm = scaled.map.norm();
    scaled_squares_ += square_beyond(norm, rho * rounding);
    velocity_squares_ += square_beyond(larger(norm / rho, -u[0]), rounding);
    scaled_q_ += rho * rho * q_square;
    if (rounding != 0) {
      rounding_squares_ += rounding * rounding;
      scaled_rounding_ += rho * rho * rounding * rounding;
    }
    return {plain.map, scaled.status};
  }

  [[nodiscard]] double natural() const { return relative(squares_, q_squares_, rounding_squares_); }
  /// The larger of its sums as impulses and as velocities (contact/natural_squares).
  [[nodiscard]] double scaled_natural() const {
    return larger_error(relative(scaled_squares_, scaled_q_, scaled_rounding_),
                        relative(velocity_squares_, q_squares_, rounding_squares_));
  }
  /// What a tolerance bounds.
  [[nodiscard]] double error() const { return larger_error(natural(), scaled_natural()); }

 private:
  /// The larger one; a if a is NaN.
  static Real larger(Real a, Real b) { return a < b ? b : a; }

  /// The natural map of a contact without the part that the rounding of its q explains.
  static Real square_beyond(Real norm, Real rounding) {
    const Real left = norm - rounding;
    return left < 0 ? Real(0) : left * left;
  }

  /// ||F|| over ||q||, or over the rounding of q if that is larger. If both are 0, it is absolute.
  static double relative(Real squares, Real q_squares, Real rounding_squares) {
    using std::isfinite, std::sqrt;  // or those of Real
    const Real scale = sqrt(larger(q_squares, rounding_squares));
    // a quotient with an infinite denominator would be 0
    if (!isfinite(scale)) return std::numeric_limits<double>::infinity();
    const Real norm = sqrt(squares);
    return error_size(scale > 0 ? norm / scale : norm);
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
