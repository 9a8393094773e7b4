// When a solve has to end: set before the conversions, checked before and in each factorisation.
#pragma once

#include <chrono>
#include <functional>
#include <limits>
#include <utility>

namespace fclib {

/// The time since some moment [s]. If it is empty, the steady clock is used.
using Clock = std::function<double()>;

inline double now(const Clock& clock) {
  if (clock) return clock();
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

class Deadline {
 public:
  /// `seconds` from now; infinite: never.
  explicit Deadline(double seconds, Clock clock = {})
      : clock_(std::move(clock)),
        at_(seconds < std::numeric_limits<double>::infinity() ? now(clock_) + seconds : seconds) {}

  [[nodiscard]] bool passed() const { return left() <= 0; }
  [[nodiscard]] double left() const {
    return at_ < std::numeric_limits<double>::infinity() ? at_ - now(clock_) : at_;
  }

 private:
  Clock clock_;
  double at_;
};

}  // namespace fclib
