// What a tolerance bounds.
#pragma once

namespace fclib {

enum class MeritKind {
  both,     ///< the natural map and the scaled one, which is the same in all units
  natural,  ///< the natural map alone, as in the literature
};

}  // namespace fclib
