// From the size of blocks to a constant at compile time.
#pragma once

#include <type_traits>

namespace fclib {

/// Calls f with the block size d (2 to 6) as std::integral_constant.
template <class F>
auto with_dimension(int d, F&& f) {
  if (d == 2) return f(std::integral_constant<int, 2>{});
  if (d == 3) return f(std::integral_constant<int, 3>{});
  if (d == 4) return f(std::integral_constant<int, 4>{});
  if (d == 5) return f(std::integral_constant<int, 5>{});
  return f(std::integral_constant<int, 6>{});
}

}  // namespace fclib
