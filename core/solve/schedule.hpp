// When to evaluate an error that costs about as much as an iteration.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace fclib {

/// Every `interval` sweeps. With 0: soon at first, then when the last two values predict that the
/// tolerance is met, and at the latest after a quarter as many sweeps as were done so far.
class Schedule {
 public:
  Schedule(std::int64_t interval, double tolerance) : interval_(interval), tolerance_(tolerance) {}

  [[nodiscard]] bool due(std::int64_t sweep) const { return sweep >= next_; }

  void evaluated(std::int64_t sweep, double error) {
    std::int64_t step = interval_;
    if (interval_ == 0) {
      step = std::max<std::int64_t>(1, sweep / 4);
      if (error < last_error_ && tolerance_ > 0) {
        const double rate =
            std::log(last_error_ / error) / static_cast<double>(sweep - last_sweep_);
        const double left = std::log(error / tolerance_) / rate;
        if (left < static_cast<double>(step)) step = std::max<std::int64_t>(1, std::llround(left));
      }
    }
    last_sweep_ = sweep;
    last_error_ = error;
    next_ = sweep + step;
  }

 private:
  std::int64_t interval_;
  double tolerance_;
  std::int64_t next_ = 1;
  std::int64_t last_sweep_ = 0;
  double last_error_ = 0;
};

}  // namespace fclib
