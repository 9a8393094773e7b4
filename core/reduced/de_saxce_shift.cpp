#include "reduced/de_saxce_shift.hpp"

namespace fclib {

template <class Cone>
void de_saxce_shift(const Vector& u, const Friction& friction, Vector& shift) {
  constexpr int D = Cone::dim;
  for (Eigen::Index a = 0; a < shift.size(); ++a) {
    double sum = 0;
    const Cone cone(friction, a);
    for_each_group<Cone>([&](auto g) {
      sum += cone.coefficient(g) * u.template segment<Cone::size(g)>(D * a + Cone::start(g)).norm();
    });
    shift[a] = sum;
  }
}

#define FCLIB_INSTANTIATE(Cone) \
  template void de_saxce_shift<Cone>(const Vector&, const Friction&, Vector&);
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
