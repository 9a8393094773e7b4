// The share of the new value in the next one of a fixed point whose steps are not solved exactly:
// where it goes around in circles, a smaller share ends that.
#pragma once

#include <algorithm>
#include <limits>

namespace fclib {

class Relaxation {
 public:
  explicit Relaxation(double share) : share_(share), smallest_(share / 8) {}

  /// After a step with this error: halved where none of the last `patience` steps had a new least.
  double next(double error) {
    if (error < least_) {
      least_ = error;
      steps_ = 0;
    } else if (++steps_ == patience) {
      share_ = std::max(share_ / 2, smallest_);
      steps_ = 0;
    }
    return share_;
  }

 private:
  static constexpr int patience = 50;
  double share_;
  double smallest_;
  double least_ = std::numeric_limits<double>::infinity();
  int steps_ = 0;
};

}  // namespace fclib
