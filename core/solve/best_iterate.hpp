// What iterative solvers have in common: the error of each iterate is told to the Monitor, the best
// iterate is kept, and it is what the solver returns.
#pragma once

#include <cstdint>
#include <optional>

#include "contact/cones.hpp"
#include "solve/solver.hpp"

namespace fclib {

template <class Cone>
class BestIterate {
 public:
  BestIterate(const ReducedProblem& problem, const Settings& settings, const Vector& r);

  /// Tells of r, u = W r + q, after `count` more iterations. Whether to stop.
  bool report(std::int64_t count, const Vector& r, const Vector& u);
  bool report(std::int64_t count, const Vector& r, double error);

  /// Tells of r between the iterates that a schedule has reported, because one is `due`. Whether to
  /// stop. As the clock says when, the error counts only where a limit ends the solver here.
  bool glance(std::int64_t count, const Vector& r);

  /// Whether a report is wanted after `count` iterations since the last.
  [[nodiscard]] bool due(std::int64_t count) const;

  [[nodiscard]] double tolerance() const { return monitor_.tolerance(); }
  [[nodiscard]] double error() const { return error_; }      ///< the least
  [[nodiscard]] double last_error() const { return last_; }  ///< of the last report
  [[nodiscard]] bool stopped() const { return stopped_.has_value(); }
  [[nodiscard]] std::int64_t iterations() const { return iterations_; }

  /// Leaves the best iterate in r. Stalled where nothing else ended the solver. `cpu_s` is that of
  /// a solver with threads of its own.
  Outcome outcome(Vector& r, std::optional<double> cpu_s = {}) const;

 private:
  void keep(std::int64_t count, const Vector& r, double error);

  const ReducedProblem& problem_;
  Monitor monitor_;
  double time_limit_;
  Vector best_, fresh_;
  double error_ = 0;
  double last_ = 0;
  std::int64_t iterations_ = 0;
  bool first_ = true;
  std::optional<Status> stopped_;
};

#define FCLIB_DECLARE(Cone) extern template class BestIterate<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
