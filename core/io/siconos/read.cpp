#include <filesystem>

#include "io/replace_file.hpp"
#include "io/siconos/siconos.hpp"

namespace fclib {

Problem read_siconos(const std::string& path, std::string_view kind) {
  const std::string text = read_file(path);
  try {
    Problem problem = parse_siconos(text, kind);
    std::visit([&](auto& p) { p.info.title = std::filesystem::path(path).stem().string(); },
               problem);
    return problem;
  } catch (const Error& error) {
    throw error.in_file(path);
  }
}

}  // namespace fclib
