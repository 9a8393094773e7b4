// The problem of one contact, solved by projections: r <- P_K(r - rho u^), u = A r + b, with a step
// rho that adapts (Khobotov's rule). For any cone; never fails, and converges as the conditioning
// of A = W_aa allows.
//
// Acary, Bremond, Huber 2018, section 4: the projection with local iterations.
#pragma once

#include "contact/cone.hpp"

namespace fclib {

template <class Cone>
class ProjectedContact {
 public:
  using Vec = typename Cone::Vec;
  using Mat = ContactMatrix<Cone::dim>;

  ProjectedContact(const Mat& a, const Cone& cone) : a_(a), cone_(cone) {
    const double largest = a.norm();
    rho_ = largest > 0 ? 1.0 / largest : 1.0;
  }

  [[nodiscard]] const Mat& block() const { return a_; }
  [[nodiscard]] const Cone& cone() const { return cone_; }

  /// Improves r by at most max_iterations projections, until a step changes r by less than
  /// `accuracy` relative to r. Never fails.
  void solve(const Vec& b, double accuracy, int max_iterations, Vec& r) {
    constexpr double contraction = 0.9;  // of a step that is accepted
    constexpr double reduction = 2.0 / 3.0;
    constexpr double growth = 1.5;
    Vec hat = cone_.modified(a_ * r + b);
    for (int k = 0; k < max_iterations; ++k) {
      Vec next = r;
      Vec next_hat = hat;
      double ratio = 0;
      double change = 0;
      for (int attempt = 0; attempt < 50; ++attempt) {
        next = cone_.project(r - rho_ * hat);
        change = (next - r).norm();
        if (change <= accuracy * r.norm()) break;
        next_hat = cone_.modified(a_ * next + b);
        ratio = rho_ * (next_hat - hat).norm() / change;
        if (ratio <= contraction) break;
        rho_ *= reduction;
      }
      const bool settled = change <= accuracy * r.norm();
      r = next;
      if (settled) return;
      hat = next_hat;
      if (ratio < 0.3) rho_ *= growth;
    }
  }

 private:
  Mat a_;
  Cone cone_;
  double rho_;  // step of the last projection
};

}  // namespace fclib
