#include "linalg/memory.hpp"

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>
#include <string_view>

namespace fclib {

namespace {

constexpr double unknown = std::numeric_limits<double>::infinity();

/// The number in a file. Unknown if there is no such file, or no number in it.
double number_in(const char* path) {
  std::ifstream file(path);
  double value = 0;
  return file >> value ? value : unknown;
}

/// The number after a word at the beginning of a line. A unit after it is ignored.
double number_behind(const char* path, std::string_view word) {
  std::ifstream file(path);
  for (std::string key; file >> key;) {
    if (double value = 0; key == word && file >> value) return value;
    file.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  return unknown;
}

}  // namespace

double available_memory() {
  constexpr double kilobyte = 1024;
  const double available = kilobyte * number_behind("/proc/meminfo", "MemAvailable:");
  const double limit = number_in("/sys/fs/cgroup/memory.max");
  const double used = number_in("/sys/fs/cgroup/memory.current");
  // file pages that the kernel gives back first
  const double idle = number_behind("/sys/fs/cgroup/memory.stat", "inactive_file");
  if (!(limit < unknown && used < unknown)) return available;
  return std::min(available, limit - used + (idle < unknown ? idle : 0));
}

}  // namespace fclib
