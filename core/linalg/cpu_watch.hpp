// CPU time of stretches that may be short.
#pragma once

#include <algorithm>
#include <chrono>

#include "linalg/cpu_time.hpp"

namespace fclib {

/// CPU time of the calling thread since it was made, for stretches that may be short: the system
/// takes 0.3 microseconds to tell it, and 0.02 for the time of the wall, which is taken for what
/// has passed since the thread last asked where that is at most `trusted`. A thread that was put
/// aside meanwhile counts as one that ran, for that long at most.
class CpuWatch {
 public:
  CpuWatch() : start_(told()) {}

  /// [s]
  double read() {
    const double now = told();
    // the child of a fork() has a clock that begins at 0
    if (now + trusted < start_) start_ = now - last_;
    last_ = std::max(last_, now - start_);
    return last_;
  }

 private:
  /// Asking costs 2 percent of this [s].
  static constexpr double trusted = 20e-6;

  /// Of this thread, all its watches: a loop of short solves seldom asks.
  static double told() {
    using Clock = std::chrono::steady_clock;
    thread_local Clock::time_point asked;
    thread_local double known = 0;  // when the system was asked
    const auto now = Clock::now();
    const double since = std::chrono::duration<double>(now - asked).count();
    if (since < trusted) return known + since;
    known = cpu_time();
    asked = now;
    return known;
  }

  double start_;
  double last_ = 0;
};

}  // namespace fclib
