// CPU time and wall clock of parts of a run that may be short.
#pragma once

#include <algorithm>
#include <chrono>

#include "linalg/cpu_time.hpp"

namespace fclib {

struct Times {
  double cpu = 0;   ///< CPU time of the calling thread [s]
  double wall = 0;  ///< wall clock [s]

  friend Times operator-(const Times& a, const Times& b) {
    return {a.cpu - b.cpu, a.wall - b.wall};
  }
};

/// The times since it was made. The system takes 0.3 microseconds to tell CPU time, and 0.02 to
/// tell the wall clock. So if the thread last asked for its CPU time at most `trusted` ago, the
/// wall clock since then is added to it. If the thread was put aside meanwhile, that time counts as
/// CPU time, at most `trusted` of it.
class Stopwatch {
 public:
  Stopwatch() : start_(told()) {}

  Times read() {
    const Times now = told();
    // the child of a fork() has a clock of CPU time that starts at 0
    if (now.cpu + trusted < start_.cpu) start_.cpu = now.cpu - last_;
    last_ = std::max(last_, now.cpu - start_.cpu);
    return {last_, now.wall - start_.wall};
  }

 private:
  /// To ask the system costs 2 percent of this [s].
  static constexpr double trusted = 20e-6;

  /// For all stopwatches of this thread: a loop of short solves seldom asks the system.
  static Times told() {
    thread_local double asked = -1;  // by the wall clock, when the system was asked last
    thread_local double known = 0;   // its CPU time then
    const double now =
        std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    if (now - asked < trusted) return {known + (now - asked), now};
    known = cpu_time();
    asked = now;
    return {known, now};
  }

  Times start_;
  double last_ = 0;  // CPU time at the last reading
};

}  // namespace fclib
