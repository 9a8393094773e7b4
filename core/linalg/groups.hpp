// Groups of numbers 0 ... n - 1 that links join (union-find).
#pragma once

#include <numeric>
#include <vector>

#include "linalg/matrix.hpp"

namespace fclib {

class Groups {
 public:
  explicit Groups(Index n) : parent_(static_cast<std::size_t>(n)) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  /// The first member of the group of k.
  Index find(Index k) {
    while (parent_[k] != k) k = parent_[k] = parent_[parent_[k]];
    return k;
  }

  void link(Index a, Index b) {
    a = find(a);
    b = find(b);
    if (a < b) parent_[b] = a;
    if (b < a) parent_[a] = b;
  }

  /// The number of the group of each. Groups are numbered by their first members.
  [[nodiscard]] std::vector<Index> numbers() {
    std::vector<Index> group(parent_.size());
    Index count = 0;
    for (Index k = 0; k < static_cast<Index>(group.size()); ++k) {
      const Index top = find(k);
      group[k] = top == k ? count++ : group[top];
    }
    return group;
  }

 private:
  std::vector<Index> parent_;
};

}  // namespace fclib
