#include "reduced/relative_error.hpp"

#include <cmath>

namespace fclib {

template <class Cone>
double natural_map_squared(const Vector& u, const Vector& r, const Friction& friction) {
  constexpr int d = Cone::dim;
  double sum = 0;
  for (Eigen::Index contact = 0; contact < friction.mu.size(); ++contact) {
    const Cone cone(friction, contact);
    sum += natural_map(cone, u.segment<d>(d * contact), r.segment<d>(d * contact)).squaredNorm();
  }
  return sum;
}

template <class Cone>
double relative_error(const ReducedProblem& problem, const Vector& u, const Vector& r) {
  return std::sqrt(natural_map_squared<Cone>(u, r, problem.friction)) / problem.scale;
}

#define FCLIB_INSTANTIATE(Cone)                                                             \
  template double natural_map_squared<Cone>(const Vector&, const Vector&, const Friction&); \
  template double relative_error<Cone>(const ReducedProblem&, const Vector&, const Vector&);
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
