#pragma once

#include <string>
#include <string_view>

namespace fclib::fuzz {

/// Reads all that an HDF5 file may hold; what is accepted must be valid. Where `write_too`, it must
/// be the same when it is written and read again, and the file takes a solution, guesses and an
/// attribute.
void read_all(const std::string& path, bool write_too);

/// Writing takes most of the time: one input in eight is enough.
inline bool writes_too(std::string_view bytes) {
  unsigned sum = 0;
  for (const char c : bytes) sum += static_cast<unsigned char>(c);
  return sum % 8 == 0;
}

}  // namespace fclib::fuzz
