// De Saxce's shift: what the modified velocity has beyond the velocity.
#pragma once

#include "contact/cones.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

/// u^ - u of each contact, in the normal direction, mu ||u_T|| (nc). `shift` has its length.
template <class Cone>
void de_saxce_shift(const Vector& u, const Friction& friction, Vector& shift);

#define FCLIB_DECLARE(Cone) \
  extern template void de_saxce_shift<Cone>(const Vector&, const Friction&, Vector&);
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
