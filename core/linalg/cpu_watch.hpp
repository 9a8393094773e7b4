// CPU time of parts of a run that may be short.
#pragma once

#include <algorithm>
#include <chrono>

#include "linalg/cpu_time.hpp"

namespace fclib {

/// CPU time of the calling thread since it was made. The system takes 0.3 microseconds to tell CPU
/// time, and 0.02 to tell the wall clock. So if the thread last asked for its CPU time at most
/// `trusted` ago, the wall clock since then is added to it. If the thread was put aside meanwhile,
/// that time counts as CPU time, at most `trusted` of it.
class CpuWatch {
 public:
  CpuWatch() : start_(told()) {}

  /// [s]
  double read() {
    const double now = told();
    // the child of a fork() has a clock that starts at 0
    if (now + trusted < start_) start_ = now - last_;
    last_ = std::max(last_, now - start_);
    return last_;
  }

 private:
  /// To ask the system costs 2 percent of this [s].
  static constexpr double trusted = 20e-6;

  /// For all watches of this thread: a loop of short solves seldom asks the system.
  static double told() {
    using Clock = std::chrono::steady_clock;
    thread_local Clock::time_point asked;
    thread_local double known = 0;  // when the system was asked last
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
