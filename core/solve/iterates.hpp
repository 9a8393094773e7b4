// Follows the iterates of a solver that need not get better each time: keeps the best one, and
// asks the monitor whether to stop.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "solve/solver.hpp"

namespace fclib {

class Iterates {
 public:
  /// `r` is where the best iterate is kept.
  Iterates(const Settings& settings, Vector& r) : monitor_(settings), best_(r) {}

  /// Takes note of an iterate. What the solver returns, if it is to stop. The monitor is told of
  /// every 16th iterate, of the last one, and of large problems whenever it wants to know.
  std::optional<Outcome> visit(std::int64_t iteration, double error, const Vector& r) {
    if (error <= error_) {
      error_ = error;
      best_ = r;
    }
    const bool told = iteration % 16 == 0 || error <= monitor_.tolerance() ||
                      iteration >= monitor_.max_iterations() ||
                      (r.size() > large && monitor_.due()) ||
                      !(error < std::numeric_limits<double>::infinity());
    if (!told) return std::nullopt;
    if (const auto stop = monitor_.report(iteration, error)) return Outcome{*stop, iteration};
    return std::nullopt;
  }

 private:
  static constexpr Eigen::Index large = 1000;  // its iterations take longer than to read a clock

  Monitor monitor_;
  Vector& best_;
  double error_ = std::numeric_limits<double>::infinity();
};

}  // namespace fclib
