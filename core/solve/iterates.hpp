// Follows the iterates of a solver that need not improve each time: keeps the best one, and asks
// the monitor whether to stop.
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
  /// The best iterate is kept in `r`.
  Iterates(const Settings& settings, Vector& r) : monitor_(settings), best_(r) {}

  /// Gets an iterate. `error()` computes its error; it is called for every `most`-th iterate, and
  /// more often at first. Returns the outcome of the solver if it must stop. The monitor gets every
  /// `most`-th iterate and the last one. For large problems it gets one whenever it wants to know.
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
  static constexpr Eigen::Index large = 1000;  // iterations take longer than to read a clock

  Monitor monitor_;
  Vector& best_;
  std::int64_t next_ = 0;       // the next iteration whose error is wanted
  std::int64_t last_told_ = 0;  // the last iteration that the monitor knows
  double error_ = std::numeric_limits<double>::infinity();
};

}  // namespace fclib
