#include "contact/projected_contact.hpp"

#include "contact/cones.hpp"

namespace fclib {

template <class Cone>
ProjectedContact<Cone>::ProjectedContact(const Mat& a, const Cone& cone) : a_(a), cone_(cone) {
  const double largest = a.norm();
  rho_ = largest > 0 ? 1.0 / largest : 1.0;
}

template <class Cone>
void ProjectedContact<Cone>::solve(const Vec& b, double accuracy, int max_iterations, Vec& r) {
  constexpr double contraction = 0.9;  // a step is accepted up to this ratio
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
    const bool converged = change <= accuracy * r.norm();
    r = next;
    if (converged) return;
    hat = next_hat;
    if (ratio < 0.3) rho_ *= growth;
  }
}

#define FCLIB_INSTANTIATE(Cone) template class ProjectedContact<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
