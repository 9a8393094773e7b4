#include "linalg/memory.hpp"

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>

namespace fclib {

namespace {

constexpr double unknown = std::numeric_limits<double>::infinity();

/// The number that a file holds; unknown where there is no such file, or no number in it.
double number_in(const char* path) {
  std::ifstream file(path);
  double value = 0;
  return file >> value ? value : unknown;
}

}  // namespace

double available_memory() {
  double available = unknown;
  std::ifstream info("/proc/meminfo");
  for (std::string key; info >> key;) {
    if (double kilobytes = 0; key == "MemAvailable:" && info >> kilobytes) {
      available = 1024 * kilobytes;
    }
    info.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  const double limit = number_in("/sys/fs/cgroup/memory.max");
  const double used = number_in("/sys/fs/cgroup/memory.current");
  if (limit < unknown && used < unknown) available = std::min(available, limit - used);
  return available;
}

}  // namespace fclib
