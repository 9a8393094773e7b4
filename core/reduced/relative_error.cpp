#include "reduced/relative_error.hpp"

#include "contact/natural_squares.hpp"

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
  constexpr int d = Cone::dim;
  NaturalSquares<double> squares;
  const bool scaled = problem.rho.size() > 0;
  for (Eigen::Index contact = 0; contact < problem.nc(); ++contact) {
    const Cone cone(problem.friction, contact);
    const typename Cone::Vec ua = u.segment<d>(d * contact);
    const typename Cone::Vec ra = r.segment<d>(d * contact);
    squares.add_plain(cone, ua, ra);
    if (scaled) squares.add_scaled(cone, ua, ra, problem.rho[contact]);
  }
  return squares.error(problem.scale, problem.scaled_scale);
}

#define FCLIB_INSTANTIATE(Cone)                                                             \
  template double natural_map_squared<Cone>(const Vector&, const Vector&, const Friction&); \
  template double relative_error<Cone>(const ReducedProblem&, const Vector&, const Vector&);
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
