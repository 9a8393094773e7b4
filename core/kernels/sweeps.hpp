// Sweeps of Gauss-Seidel over the contacts in an order that may change: one after another with the
// velocities kept up to date by columns of W (kernels/gauss_seidel.hpp), or on several threads,
// colour by colour, by rows of W (kernels/coloured_sweeps.hpp).
#pragma once

#include <algorithm>
#include <numeric>
#include <optional>
#include <random>

#include "kernels/coloured_sweeps.hpp"
#include "kernels/gauss_seidel.hpp"

namespace fclib {

template <class Cone>
class Sweeps {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;

  /// With omega, the contacts' problems are those of W_aa / omega: projected over-relaxation.
  Sweeps(const Delassus& problem, std::int64_t threads, double omega = 1) {
    if (threads > 1) {
      start_ = cpu_time();
      coloured_.emplace(problem, omega, static_cast<int>(threads));
    } else {
      contacts_.emplace(problem, omega);
      order_.resize(static_cast<std::size_t>(problem.nc()));
      std::iota(order_.begin(), order_.end(), 0);
    }
  }

  /// Of the contacts; of the colours where there are several threads.
  void shuffle(std::mt19937_64& random) {
    // Fisher-Yates by hand: std::shuffle differs between standard libraries
    const auto mix = [&](auto& order) {
      for (std::size_t k = order.size(); k > 1; --k) std::swap(order[k - 1], order[random() % k]);
    };
    coloured_ ? mix(coloured_->sequence()) : mix(order_);
  }

  void reverse() { coloured_ ? coloured_->reverse() : std::reverse(order_.begin(), order_.end()); }

  /// Calls visit(a) for each contact, on several threads for contacts that are not coupled.
  template <class Visit>
  void sweep(const Visit& visit) {
    if (coloured_) return coloured_->sweep(visit);
    for (const Index a : order_) visit(a);
  }

  /// Solves the problem of contact a in a sweep, as GaussSeidel does; u is not kept up to date
  /// where there are several threads. The change of r^a.
  template <class Step>
  Vec update(Index a, Vector& r, Vector& u, const Step& step) {
    return coloured_ ? coloured_->update(a, r, step) : contacts_->update(a, r, u, step);
  }

  /// u = W r + q after a sweep; of one thread it is there, but for the rounding of the updates.
  void velocity(const Vector& r, Vector& u) {
    if (coloured_) coloured_->velocity(r, u);
  }

  /// CPU time of all threads until now, where there are several [s].
  [[nodiscard]] std::optional<double> cpu_s() const {
    if (!coloured_) return std::nullopt;
    return cpu_time() - start_ + coloured_->cpu_s();
  }

 private:
  std::optional<GaussSeidel<Cone>> contacts_;
  std::vector<Index> order_;
  std::optional<ColouredSweeps<Cone>> coloured_;
  double start_ = 0;
};

}  // namespace fclib
