// The list of cones, for code that is compiled once for each of them.
#pragma once

#include "contact/coulomb.hpp"
#include "contact/rolling.hpp"

/// Calls the macro X with each cone, X(Coulomb<2>) ..., to instantiate templates in their .cpp
/// file.
#define FCLIB_FOR_EACH_CONE(X) \
  X(Coulomb<2>)                \
  X(Coulomb<3>)                \
  X(Rolling<3>)                \
  X(Rolling<5>)
