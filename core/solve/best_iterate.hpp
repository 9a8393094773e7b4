// What iterative solvers have in common: the error of each iterate is told to the Monitor, the best
// iterate is kept, and it is what the solver returns.
#pragma once

#include <algorithm>
#include <cmath>

#include "kernels/natural_error.hpp"
#include "solve/solver.hpp"

namespace fclib {

template <class Cone>
class BestIterate {
 public:
  BestIterate(const Delassus& problem, const Settings& settings, const Vector& r)
      : problem_(problem),
        monitor_(settings),
        time_limit_(settings.time_limit),
        best_(r),
        fresh_(r.size()) {}

  /// The error of r; u = W r + q may carry the rounding of updates.
  [[nodiscard]] double error_of(const Vector& r, const Vector& u) const {
    return std::sqrt(natural_map_squared<Cone>(u, r, problem_.friction)) / problem_.scale;
  }

  /// Tells of r, u = W r + q, after `count` more iterations. Whether to stop.
  bool report(std::int64_t count, const Vector& r, const Vector& u) {
    last_ = error_of(r, u);
    if (last_ <= monitor_.tolerance()) {
      problem_.velocity(r, fresh_);
      last_ = error_of(r, fresh_);
    }
    return report(count, r, last_);
  }
  bool report(std::int64_t count, const Vector& r, double error) {
    last_ = error;
    keep(count, r, error);
    if (first_ || count > 0) stopped_ = monitor_.report(iterations_, error);
    first_ = false;
    return stopped_.has_value();
  }

  /// Tells of r between the iterates that a schedule has reported, because one is `due`. Whether to
  /// stop. As the clock says when, the error counts only where a limit ends the solver here.
  bool glance(std::int64_t count, const Vector& r) {
    problem_.velocity(r, fresh_);
    const double error = error_of(r, fresh_);
    const std::int64_t now = iterations_ + count;
    const auto status = monitor_.report(now, error);
    const bool last = now >= monitor_.max_iterations() || monitor_.elapsed() > time_limit_;
    if (!status || (*status == Status::converged && !last)) return false;
    keep(count, r, error);
    stopped_ = status;
    return true;
  }

  /// Whether a report is wanted after `count` iterations since the last.
  [[nodiscard]] bool due(std::int64_t count) const {
    return iterations_ + count >= monitor_.max_iterations() || (count % 8 == 0 && monitor_.due());
  }

  [[nodiscard]] double tolerance() const { return monitor_.tolerance(); }
  [[nodiscard]] double error() const { return error_; }      ///< the least
  [[nodiscard]] double last_error() const { return last_; }  ///< of the last report
  [[nodiscard]] bool stopped() const { return stopped_.has_value(); }
  [[nodiscard]] std::int64_t iterations() const { return iterations_; }

  /// Leaves the best iterate in r. Stalled where nothing else ended the solver. `cpu_s` is that of
  /// a solver with threads of its own.
  Outcome outcome(Vector& r, std::optional<double> cpu_s = {}) const {
    r = best_;
    return {
        .status = stopped_.value_or(Status::stalled), .iterations = iterations_, .cpu_s = cpu_s};
  }

 private:
  void keep(std::int64_t count, const Vector& r, double error) {
    if (first_ || error < error_) {
      error_ = error;
      best_ = r;
    }
    iterations_ += count;
  }

  const Delassus& problem_;
  Monitor monitor_;
  double time_limit_;
  Vector best_, fresh_;
  double error_ = 0;
  double last_ = 0;
  std::int64_t iterations_ = 0;
  bool first_ = true;
  std::optional<Status> stopped_;
};

}  // namespace fclib
