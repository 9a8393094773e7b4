// The bodies that the contacts of an island move.
#pragma once

#include <span>
#include <vector>

#include "reduced/reduced_problem.hpp"

namespace fclib {

/// Serves one island after another: each costs what its own bodies and contacts cost.
class IslandBodies {
 public:
  /// `whole` must outlive this.
  explicit IslandBodies(const Primal& whole);

  /// The coordinates that these contacts move, with those that M links to them, in their order.
  [[nodiscard]] Primal of(std::span<const Index> contacts, int d);

 private:
  const Primal& whole_;
  std::vector<Index> place_;  // of each coordinate in the island; -1 between two calls
};

}  // namespace fclib
