#include "error.hpp"

#include <utility>

namespace fclib {

namespace {

std::string join(const std::string& file, const std::string& where, const std::string& message) {
  std::string text;
  for (const auto* part : {&file, &where}) {
    if (!part->empty()) text += *part + ": ";
  }
  return text + message;
}

}  // namespace

Error::Error(ErrorKind kind, std::string message, std::string where, std::string file)
    : std::runtime_error(join(file, where, message)),
      kind(kind),
      message(std::move(message)),
      where(std::move(where)),
      file(std::move(file)) {}

Error Error::in_file(const std::string& path) const { return {kind, message, where, path}; }

}  // namespace fclib
