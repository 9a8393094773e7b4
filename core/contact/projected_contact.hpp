// The problem of one contact, solved by projections: r <- P_K(r - rho u^), u = A r + b, with a step
// rho that adapts (Khobotov's rule). It takes any cone and never fails. How fast it converges
// depends on the conditioning of A = W_aa.
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

  ProjectedContact(const Mat& a, const Cone& cone);

  [[nodiscard]] const Mat& block() const { return a_; }
  [[nodiscard]] const Cone& cone() const { return cone_; }

  /// Improves r by at most max_iterations projections. It ends if a step changes r by less than
  /// `accuracy` relative to r. Never fails.
  void solve(const Vec& b, double accuracy, int max_iterations, Vec& r);

 private:
  Mat a_;
  Cone cone_;
  double rho_;  // step of the last projection
};

}  // namespace fclib
