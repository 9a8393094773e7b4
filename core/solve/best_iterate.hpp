// What iterative solvers share: the Monitor gets the error of each iterate, the best iterate is
// kept, and the solver returns it.
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

  /// Reports r and u = W r + q after `count` more iterations. Returns whether to stop.
  bool report(std::int64_t count, const Vector& r, const Vector& u);
  bool report(std::int64_t count, const Vector& r, double error);

  /// Reports r between the iterates that a schedule reports, because one is `due`. Returns whether
  /// to stop. Since the clock decides when, the error counts only if a limit ends the solver here.
  bool glance(std::int64_t count, const Vector& r);

  /// Whether a report is wanted `count` iterations after the last one.
  [[nodiscard]] bool due(std::int64_t count) const;

  [[nodiscard]] double tolerance() const { return monitor_.tolerance(); }
  [[nodiscard]] double error() const { return error_; }      ///< the least
  [[nodiscard]] double last_error() const { return last_; }  ///< of the last report
  [[nodiscard]] bool stopped() const { return stopped_.has_value(); }
  [[nodiscard]] std::int64_t iterations() const { return iterations_; }

  /// Leaves the best iterate in r. The status is stalled if nothing else ended the solver. `cpu_s`
  /// is for a solver with threads of its own.
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
