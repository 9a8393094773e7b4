// De Saxce's shift: the modified velocity less the velocity.
#pragma once

#include "contact/cones.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

/// u^ - u of each contact, mu ||u_T|| (nc), in the normal direction. `shift` must have this length.
template <class Cone>
void de_saxce_shift(const Vector& u, const Friction& friction, Vector& shift);

#define FCLIB_DECLARE(Cone) \
  extern template void de_saxce_shift<Cone>(const Vector&, const Friction&, Vector&);
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
