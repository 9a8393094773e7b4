#include "reduced/convex_residual.hpp"

#include <cmath>

namespace fclib {

template <class Set>
double convex_residual(const ReducedProblem& problem, const Set& set, const Vector& shift,
                       const Vector& r, const Vector& u) {
  constexpr int D = Set::Cone::dim;
  using Vec = typename Set::Cone::Vec;
  double sum = 0;
  for (Index a = 0; a < problem.nc(); ++a) {
    const Vec now = r.template segment<D>(D * a);
    Vec slope = u.template segment<D>(D * a);
    slope[0] += shift[a];
    sum += (now - set.project(a, now - slope, now)).squaredNorm();
  }
  return std::sqrt(sum) / problem.scale;
}

#define FCLIB_INSTANTIATE_SET(Set)                                                       \
  template double convex_residual<Set>(const ReducedProblem&, const Set&, const Vector&, \
                                       const Vector&, const Vector&);
#define FCLIB_INSTANTIATE(Cone) \
  FCLIB_INSTANTIATE_SET(Cones<Cone>) FCLIB_INSTANTIATE_SET(Cylinders<Cone>)
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE
#undef FCLIB_INSTANTIATE_SET

}  // namespace fclib
