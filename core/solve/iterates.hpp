// Follows the iterates of a solver that need not get better each time: keeps the best one, and
// asks the monitor whether to stop.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>

#include "function_ref.hpp"
#include "solve/solver.hpp"

namespace fclib {

class Iterates {
 public:
  /// `r` is where the best iterate is kept.
  Iterates(const Settings& settings, Vector& r) : monitor_(settings), best_(r) {}

  /// Takes note of an iterate, `error()` being its error, which is asked for every `most`-th
  /// iterate, more often at first. What the solver returns, if it is to stop. The monitor is told
  /// of every `most`-th iterate, of the last one, and of large problems whenever it wants to know.
  std::optional<Outcome> visit(std::int64_t iteration, const Vector& r,
                               FunctionRef<double()> error) {
    const bool asked = r.size() > large && monitor_.due();
    if (iteration < next_ && iteration < monitor_.max_iterations() && !asked) return std::nullopt;
    next_ = iteration + 1 + std::min(iteration / most, most - 1);
    const double value = error();
    if (value <= error_) {
      error_ = value;
      best_ = r;
    }
    const bool told = iteration >= last_told_ + most || value <= monitor_.tolerance() ||
                      iteration == 0 || iteration >= monitor_.max_iterations() || asked ||
                      !(value < std::numeric_limits<double>::infinity());
    if (!told) return std::nullopt;
    last_told_ = iteration;
    if (const auto stop = monitor_.report(iteration, value, &r)) return Outcome{*stop, iteration};
    return std::nullopt;
  }

 private:
  static constexpr std::int64_t most = 8;
  static constexpr Eigen::Index large = 1000;  // its iterations take longer than to read a clock

  Monitor monitor_;
  Vector& best_;
  std::int64_t next_ = 0;       // iteration whose error is wanted
  std::int64_t last_told_ = 0;  // ... that the monitor knows
  double error_ = std::numeric_limits<double>::infinity();
};

}  // namespace fclib
