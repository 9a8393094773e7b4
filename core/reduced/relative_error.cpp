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
  const double natural =
      std::sqrt(natural_map_squared<Cone>(u, r, problem.friction)) / problem.scale;
  if (problem.rho.size() == 0) return natural;
  constexpr int d = Cone::dim;
  double sum = 0;
  for (Eigen::Index contact = 0; contact < problem.rho.size(); ++contact) {
    const Cone cone(problem.friction, contact);
    sum += natural_map(cone, u.segment<d>(d * contact), r.segment<d>(d * contact),
                       problem.rho[contact])
               .squaredNorm();
  }
  const double scaled = std::sqrt(sum) / problem.scaled_scale;
  return scaled <= natural ? natural : scaled;  // of a NaN the NaN
}

#define FCLIB_INSTANTIATE(Cone)                                                             \
  template double natural_map_squared<Cone>(const Vector&, const Vector&, const Friction&); \
  template double relative_error<Cone>(const ReducedProblem&, const Vector&, const Vector&);
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
