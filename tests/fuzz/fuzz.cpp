#include "fuzz.hpp"

#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>

namespace fclib::fuzz {

namespace fs = std::filesystem;

const fs::path& scratch() {
  static const struct Folder {
    Folder() {
      std::string name = (fs::temp_directory_path() / "fclib-fuzz-XXXXXX").string();
      require(::mkdtemp(name.data()) != nullptr, "a temporary folder can be made");
      path = name;
    }
    ~Folder() {
      std::error_code error;
      fs::remove_all(path, error);
    }
    fs::path path;
  } folder;
  return folder.path;
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
