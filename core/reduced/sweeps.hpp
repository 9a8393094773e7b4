// Sweeps of Gauss-Seidel over the contacts in an order that may change. With one thread, contacts
// follow one another and columns of W keep the velocities up to date (reduced/gauss_seidel.hpp).
// With several threads, colours follow one another, by rows of W (reduced/coloured_sweeps.hpp).
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include "reduced/coloured_sweeps.hpp"
#include "reduced/gauss_seidel.hpp"

namespace fclib {

template <class Cone>
class Sweeps {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;

  /// With omega, the problems have W_aa / omega in place of W_aa: projected over-relaxation.
  Sweeps(const ReducedProblem& problem, std::int64_t threads, double omega = 1);

  /// The order of the contacts. With several threads, the order of the colours.
  void shuffle(std::mt19937_64& random);

  void reverse() { coloured_ ? coloured_->reverse() : std::reverse(order_.begin(), order_.end()); }

  /// Calls visit(a) for each contact. Several threads work on contacts that are not coupled.
  void sweep(FunctionRef<void(Index)> visit);

  /// Solves the problem of contact a in a sweep, like GaussSeidel. With several threads, u is not
  /// kept up to date. Returns the change of r^a.
  Vec update(Index a, Vector& r, Vector& u, const LocalStep<Cone>& step);

  /// u = W r + q after a sweep. With one thread it is there already, up to the rounding of the
  /// updates.
  void velocity(const Vector& r, Vector& u);

  /// CPU time of all threads until now, if there are several [s].
  [[nodiscard]] std::optional<double> cpu_s() const;

 private:
  std::optional<GaussSeidel<Cone>> contacts_;
  std::vector<Index> order_;
  std::optional<ColouredSweeps<Cone>> coloured_;
  double start_ = 0;
};

#define FCLIB_DECLARE(Cone) extern template class Sweeps<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
