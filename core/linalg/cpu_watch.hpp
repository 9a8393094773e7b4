// CPU time of stretches that may be short.
#pragma once

#include <algorithm>
#include <chrono>

#include "linalg/cpu_time.hpp"

namespace fclib {

/// CPU time of the calling thread since it was made, for stretches that may be short: the system
/// takes 0.4 microseconds to tell it, and 0.02 for the time of the wall, which is taken for what
/// has passed since the system was last asked where that is at most `trusted`. A thread that was
/// put aside meanwhile counts as one that ran, for that long at most.
class CpuWatch {
 public:
  CpuWatch() : start_(cpu_time()), asked_(std::chrono::steady_clock::now()) {}

  /// [s]
  double read() {
    const auto now = std::chrono::steady_clock::now();
    const double since = std::chrono::duration<double>(now - asked_).count();
    if (since < trusted) {
      last_ = std::max(last_, known_ + since);
    } else {
      known_ = cpu_time() - start_;
      asked_ = now;
      last_ = std::max(last_, known_);
    }
    return last_;
  }

 private:
  /// Asking costs 2 percent of this [s].
  static constexpr double trusted = 20e-6;

  double start_;
  std::chrono::steady_clock::time_point asked_;
  double known_ = 0;  ///< when the system was asked
  double last_ = 0;
};

}  // namespace fclib
