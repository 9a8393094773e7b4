// The clock of CPU time.
#pragma once

#include <ctime>

namespace fclib {

/// CPU time of the calling thread [s]. If the system has no such clock, it is wall clock time.
inline double cpu_time() {
  timespec now{};
  if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now) != 0) clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace fclib
