// The clock of CPU time.
#pragma once

#include <chrono>
#include <ctime>

namespace fclib {

/// CPU time of the calling thread [s]. If the system has no such clock, it is wall clock time.
inline double cpu_time() {
#ifdef CLOCK_THREAD_CPUTIME_ID
  timespec now{};
  if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now) == 0) {
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  }
#endif
  const auto wall = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration<double>(wall).count();
}

}  // namespace fclib
