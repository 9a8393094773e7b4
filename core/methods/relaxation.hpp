// The relaxation of a fixed point whose steps are not solved exactly: the share of the new value in
// the next one. If the iterates go around in circles, a smaller share ends that.
#pragma once

#include <algorithm>
#include <limits>

namespace fclib {

class Relaxation {
 public:
  explicit Relaxation(double share) : share_(share), smallest_(share / 8) {}

  /// After a step with this error. It is halved if none of the last `patience` steps had a new
  /// least error.
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
