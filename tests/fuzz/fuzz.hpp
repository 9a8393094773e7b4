// Fuzzing of the readers. A target takes any bytes and reads them as a user would; it returns where
// they were read or refused with a proper Error, and aborts, or is stopped by a sanitizer, where
// the library did anything else.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "error.hpp"

namespace fclib::fuzz {

struct Input {
  std::string name;
  std::string bytes;
};

struct Target {
  std::string_view name;
  void (*run)(std::string_view bytes);
  std::vector<Input> (*seeds)();
};

extern const Target hdf5_bytes;    ///< the bytes are an HDF5 file
extern const Target hdf5_objects;  ///< the bytes choose what is changed in a valid FCLIB file
extern const Target siconos_text;  ///< the bytes are a text of Siconos

inline const Target* const targets[] = {&hdf5_bytes, &hdf5_objects, &siconos_text};

/// A folder of this process, in that for temporary files; removed at the end.
const std::filesystem::path& scratch();

/// Puts a new file in place of an old one; never the same inode twice in a row, by which HDF5 would
/// take it for a file that it still has open.
void put_file(const std::string& path, std::string_view bytes);

/// Prints what does not hold, and aborts.
void require(bool holds, const std::string& what);

/// Whether body() ran to its end; false where it threw an Error, which must name the file in one
/// printable line. Anything else that it throws passes through.
template <class Body>
bool accepted(const std::string& path, const Body& body) {
  try {
    body();
    return true;
  } catch (const Error& error) {
    const std::string message = error.what();
    require(message.starts_with(path + ": "), "the file is named: " + message);
    require(message.size() < path.size() + 300, "short: " + message);
    for (const char c : message) require(c >= ' ' && c != '\x7f', "printable: " + message);
    return false;
  }
}

}  // namespace fclib::fuzz
