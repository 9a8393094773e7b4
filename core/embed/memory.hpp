// Memory that is kept.
#pragma once

#include <cstddef>
#include <vector>

namespace fclib {

/// Makes it at least this long; it never gets shorter.
template <class T>
void grow(std::vector<T>& vector, std::size_t size) {
  if (vector.size() < size) vector.resize(size);
}

}  // namespace fclib
