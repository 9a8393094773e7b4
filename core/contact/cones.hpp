// The list of cones of solvers, for code that is compiled once for each of them.
#pragma once

#include "contact/coulomb.hpp"
#include "contact/rolling.hpp"
#include "contact/spin.hpp"

/// Calls the macro X with each cone, X(Coulomb<2>) ..., to instantiate templates in
/// their .cpp file.
#define FCLIB_FOR_EACH_CONE(X) \
  X(Coulomb<2>)                \
  X(Coulomb<3>)                \
  X(Coulomb<4>)                \
  X(Rolling<3>)                \
  X(Rolling<5>)                \
  X(Spin<4>)                   \
  X(Spin<6>)

/// Calls the macro X with each size of a contact.
#define FCLIB_FOR_EACH_DIMENSION(X) X(2) X(3) X(4) X(5) X(6)
