// The problem of one contact, solved exactly: given A = W_aa (D x D) and b = u - A r, find r so
// that r and A r + b satisfy Coulomb's law.
//
// It tries the three statuses. Open if b_N >= 0. Stick if -A^-1 b is in the cone. Else slip, u_T =
// -alpha r_T with alpha > 0, and with
//
//   S = A_TT - A_TN A_NT / A_NN,   c = b_T - A_TN b_N / A_NN
//   r_T(alpha) = -(S + alpha I)^-1 c,   r_N(alpha) = -(b_N + A_NT r_T) / A_NN
//
// alpha is the root of h(alpha) = mu r_N / ||r_T|| - 1, found by a bracketed Newton method. The
// quartic of Bonnefon & Daviet, "Quartic formulation of Coulomb 3D frictional contact" (2011), has
// the same roots.
//
// Fingers and legs of one or two joints have blocks of rank 1 or 2, and their S is singular up to
// rounding. Its small eigenvalues are then set to zero, and so is the part of c along them, since
// no r_T has an effect on that part. Stick takes the smallest r_T. If that part is more than
// rounding, the contact slides. If both stick and slip are possible, the one with the smaller
// natural map is taken.
#pragma once

#include <cmath>
#include <limits>

#include "contact/cone.hpp"

namespace fclib {

template <int D>
class ExactContact {
  static_assert(D == 2 || D == 3);

 public:
  using Vec = ContactVector<D>;
  using Mat = ContactMatrix<D>;
  static constexpr int T = D - 1;
  using TangentVec = Eigen::Matrix<double, T, 1>;
  using TangentMat = Eigen::Matrix<double, T, T>;

  ExactContact(const Mat& a, double mu);

  /// Replaces r by an exact solution. Returns false, and leaves r untouched, if none is found: the
  /// block has no normal part, or with this coupling and mu the slip equation has no root. Sliding
  /// reactions may be as far from the solution as `close`.
  bool solve(const Vec& b, Vec& r, double close = 0) {
    if (b[0] >= 0) {
      r.setZero();
      return true;
    }
    if (!solvable_) return false;
    const TangentVec c = b.template tail<T>() - to_tangent_ * b[0];
    const double free_normal = -b[0] / normal_;  // r_N if r_T = 0
    if (singular_ && mu_ != 0) return solve_singular(b, c, free_normal, r, close);

    if (mu_ == 0) {
      r.setZero();
      r[0] = free_normal;
      return true;
    }
    if (sticks_ || c.squaredNorm() == 0) {
      const TangentVec rt = sticks_ ? TangentVec(-inverse_ * c) : TangentVec(TangentVec::Zero());
      const double rn = free_normal - to_normal_.dot(rt);
      if (rt.squaredNorm() <= mu_ * mu_ * rn * rn && rn >= 0) {
        r[0] = rn;
        r.template tail<T>() = rt;
        return true;
      }
    }
    return slip(c, free_normal, r, close);
  }

 private:
  static constexpr double tiny = 1e-14;
  /// Relative to A_TT: S is a difference from it, so eigenvalues up to this are zero.
  static constexpr double rounding = 1e-13;
  /// Relative to the terms of c: so much of c is rounding. b is a difference and rounds too.
  static constexpr double rounding_of_c = 1e-12;

  /// Sets the eigenvalues of S that are only rounding to zero.
  void reveal_rank(const Mat& a);

  /// Like solve(), if S is singular, b_N < 0 and mu > 0.
  bool solve_singular(const Vec& b, const TangentVec& c, double free_normal, Vec& r, double close);

  /// The natural map of this contact alone.
  [[nodiscard]] double left(const Vec& b, const Vec& r) const;

  static double determinant(const TangentMat& s) {
    if constexpr (T == 1) {
      return s(0, 0);
    } else {
      return s(0, 0) * s(1, 1) - s(0, 1) * s(1, 0);
    }
  }

  static TangentMat shifted_inverse(TangentMat s, double alpha) {
    for (int k = 0; k < T; ++k) s(k, k) += alpha;
    TangentMat inverse;
    if constexpr (T == 1) {
      inverse(0, 0) = 1.0 / s(0, 0);
    } else {
      const double scale = 1.0 / determinant(s);
      inverse << s(1, 1) * scale, -s(0, 1) * scale, -s(1, 0) * scale, s(0, 0) * scale;
    }
    return inverse;
  }

  bool slip(const TangentVec& c, double free_normal, Vec& r, double close) {
    if constexpr (T == 1) {
      // |r_T| = mu r_N against the sliding, which has the sign of c
      const double direction = c[0] > 0 ? -1.0 : 1.0;
      const double denominator = 1.0 + mu_ * direction * to_normal_[0];
      if (!(denominator > 0)) return false;
      r[0] = free_normal / denominator;
      r[1] = direction * mu_ * r[0];
      return true;
    } else {
      // h < 0 at alpha -> 0 (stick was refused), h > 0 for large alpha (r_T -> 0, r_N -> free)
      double low = 0;
      double high = std::numeric_limits<double>::infinity();
      double alpha = alpha_ > 0 ? alpha_ : c.norm() / (mu_ * free_normal);
      TangentVec rt;
      double rn = 0;
      double norm = 0;
      bool last = false;  // Newton squares the error: below 1e-8 one step is the last
      for (int k = 0; k < 60; ++k) {
        const TangentMat inverse = shifted_inverse(schur_, alpha);
        rt = -(inverse * c);
        rn = free_normal - to_normal_.dot(rt);
        norm = rt.norm();
        const double h = mu_ * rn / norm - 1.0;
        if (last || std::abs(h) <= 1e-15 || std::abs(h) * norm <= close) break;
        (h > 0 ? high : low) = alpha;
        const TangentVec slope = -(inverse * rt);  // d r_T / d alpha
        const double h_slope =
            (-mu_ * to_normal_.dot(slope) - (h + 1.0) * rt.dot(slope) / norm) / norm;
        double next = alpha - h / h_slope;
        last = std::abs(h) <= 1e-8;
        if (!(next > low && next < high)) {
          next = high < std::numeric_limits<double>::infinity() ? 0.5 * (low + high) : 4.0 * alpha;
          last = false;
        }
        if (std::abs(next - alpha) <= 1e-15 * alpha) break;
        alpha = next;
      }
      if (!(rn > 0) || !std::isfinite(norm) || norm == 0) return false;
      alpha_ = alpha;
      r[0] = rn;
      r.template tail<T>() = (mu_ * rn / norm) * rt;
      return true;
    }
  }

  double mu_ = 0;
  double normal_ = 0;  // A_NN
  double trace_ = 0;
  bool solvable_ = false;                       // A_NN > 0
  bool sticks_ = false;                         // S is regular
  TangentVec to_normal_ = TangentVec::Zero();   // A_NT / A_NN
  TangentVec to_tangent_ = TangentVec::Zero();  // A_TN / A_NN
  TangentMat schur_ = TangentMat::Zero();       // S
  TangentMat inverse_ = TangentMat::Zero();     // S^-1
  // used if S is singular up to rounding
  bool singular_ = false;
  TangentMat range_ = TangentMat::Zero();  // the projection on what is left of S
  Mat block_ = Mat::Zero();                // A
  double alpha_ = 0;                       // root of the last slip, a warm start
};

}  // namespace fclib
