#include "fuzz.hpp"

#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "temporary_folder.hpp"

namespace fclib::fuzz {

namespace fs = std::filesystem;

const fs::path& scratch() {
  static const testing::TemporaryFolder folder;
  return folder.path();
}

void put_file(const std::string& path, std::string_view bytes) {
  const std::string beside = path + ".new";
  std::ofstream stream(beside, std::ios::binary);
  stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  stream.close();
  require(stream.good(), "a temporary file can be written");
  fs::rename(beside, path);
}

void require(bool holds, const std::string& what) {
  if (holds) return;
  std::fprintf(stderr, "does not hold: %s\n", what.c_str());
  std::abort();
}

}  // namespace fclib::fuzz
