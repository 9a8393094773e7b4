// The cones that there are, for what is compiled once for each of them.
#pragma once

#include "contact/coulomb.hpp"
#include "contact/rolling.hpp"

/// Calls the macro X with each cone: X(Coulomb<2>) ... To instantiate templates in their .cpp file.
#define FCLIB_FOR_EACH_CONE(X) \
  X(Coulomb<2>)                \
  X(Coulomb<3>)                \
  X(Rolling<3>)                \
  X(Rolling<5>)
