// What a chain knows of its own run: iterations, stages, the error of the islands that it does not
// work on now, and why it stops.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "linalg/stopwatch.hpp"
#include "solve/solver.hpp"

namespace fclib::chain {

/// Follows the whole solve: iterations, stages, and the error of the islands that wait.
class Tracker {
 public:
  explicit Tracker(const Settings& settings) : monitor_(settings) {}

  [[nodiscard]] double tolerance() const { return monitor_.tolerance(); }
  [[nodiscard]] std::optional<Status> stopped() const { return stopped_; }
  [[nodiscard]] std::int64_t iterations() const { return iterations_; }
  [[nodiscard]] std::vector<Stage>& stages() { return stages_; }

  /// Notes that matrices of so many bytes are not made, because only `limit` bytes are there.
  void without_factors(double bytes, double limit) {
    if (bytes <= too_large_) return;
    too_large_ = bytes;
    char text[120];
    std::snprintf(text, sizeof text,
                  "matrices of %.3g GB do not fit into %.3g GB of memory: methods that need them "
                  "were left out",
                  bytes / 1e9, limit / 1e9);
    message_ = text;
  }
  [[nodiscard]] const std::string& message() const { return message_; }

  /// There is no solution.
  void refuse() { stopped_ = Status::infeasible; }

  /// CPU time of other threads than the caller's [s].
  void add_cpu(double seconds) { others_cpu_ += seconds; }
  [[nodiscard]] double others_cpu() const { return others_cpu_; }

  /// The squared error of all contacts that are not worked on now.
  void set_others(double squared) { others_ = squared; }

  /// All reactions, and the contacts of the island that is worked on now. No contacts: all of them.
  void set_island(const Vector& all, std::span<const Index> contacts, int d) {
    if (!monitor_.watched()) return;
    all_ = all;
    contacts_ = contacts;
    d_ = d;
  }

  /// Counts iterations and reports the error that is left, with r of the island. Returns whether
  /// the stage should end: because everything stops, or because the iterate is not finite.
  bool report(std::int64_t iterations, double error, const Vector& r) {
    const bool first = iterations_ == 0 && !reported_;
    iterations_ += iterations;
    reported_ = true;
    const double all = std::sqrt(others_ + error * error);
    const bool finite = std::isfinite(all);
    if (!stopped_ && (iterations > 0 || first)) {
      // an error that has overflown is not reported, but its iterations count
      if (finite) told_ = all;
      stopped_ = monitor_.report(iterations_, told_, shown(r));
    }
    return stopped_.has_value() || !finite;
  }
  /// Whether to stop `iterations` after the last report. It may be asked at any time: the monitor
  /// gets a report only if one is due.
  bool glance(std::int64_t iterations, const Vector& r) {
    if (!stopped_ && monitor_.due()) {
      stopped_ = monitor_.report(iterations_ + iterations, told_, shown(r));
    }
    return stopped_.has_value();
  }
  /// The iterations that may still be made.
  [[nodiscard]] std::int64_t left() const { return monitor_.max_iterations() - iterations_; }

  /// Runs a stage. The stage returns the factorisations that it made and whether it solved.
  template <class F>
  void stage(std::string_view name, std::string_view families, const F& run) {
    auto at = std::find_if(stages_.begin(), stages_.end(),
                           [&](const Stage& stage) { return stage.kind.name == name; });
    if (at == stages_.end()) {
      at = stages_.insert(stages_.end(), Stage{.kind = {std::string(name), std::string(families)}});
    }
    monitor_.enter(name);
    const auto place = at - stages_.begin();  // a stage may run inside another one
    Stopwatch watch;
    const double others = others_cpu_;
    const auto before = iterations_;
    const auto [factorisations, solved] = run();
    Stage& stage = stages_[static_cast<std::size_t>(place)];
    ++stage.calls;
    stage.solved += solved;
    stage.iterations += iterations_ - before;
    stage.factorisations += factorisations;
    const Times spent = watch.read();
    stage.cpu_s += spent.cpu + (others_cpu_ - others);
    stage.time += spent.wall;
  }

 private:
  /// All reactions, for the callback.
  const Vector* shown(const Vector& r) {
    if (!monitor_.watched() || contacts_.empty()) return &r;
    for (std::size_t k = 0; k < contacts_.size(); ++k) {
      const auto from = static_cast<Eigen::Index>(k) * d_;
      all_.segment(Eigen::Index{contacts_[k]} * d_, d_) = r.segment(from, d_);
    }
    return &all_;
  }

  Monitor monitor_;
  double too_large_ = 0;  // bytes of the largest matrices that are not made
  std::string message_;
  double others_ = 0;
  double told_ = std::numeric_limits<double>::max();  // the last finite error that was reported
  double others_cpu_ = 0;
  std::int64_t iterations_ = 0;
  bool reported_ = false;
  std::optional<Status> stopped_;
  std::vector<Stage> stages_;
  Vector all_;
  std::span<const Index> contacts_;
  int d_ = 0;
};

}  // namespace fclib::chain
