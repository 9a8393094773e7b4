// The symbolic part of a multifrontal factorisation of a matrix whose pattern is symmetric (Duff &
// Reid, "The multifrontal solution of indefinite sparse symmetric linear systems", 1983): an
// ordering of the blocks, and supernodes with relaxed amalgamation. Nothing numeric.
//
// The ordering is by approximate minimum degree or, where that leaves many operations and the build
// has METIS, by nested dissection (Karypis & Kumar 1998) where this takes fewer.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "linalg/matrix.hpp"

namespace fclib {

/// The symmetric pattern of a matrix of d x d blocks, by columns, with all diagonal blocks.
/// Block k of the pattern has its values in values[d*d*k ...], by columns.
struct BlockPattern {
  int d = 1;
  std::vector<std::int64_t> first;  // (nodes + 1)
  std::vector<Index> row;

  [[nodiscard]] Index nodes() const { return static_cast<Index>(first.size()) - 1; }
  [[nodiscard]] bool operator==(const BlockPattern&) const = default;
  [[nodiscard]] std::size_t values() const {
    return static_cast<std::size_t>(d) * static_cast<std::size_t>(d) * row.size();
  }
};

struct Front {
  struct Entry {  // one block of A, and where it goes in its front
    std::int64_t block;
    Index row, col;  // scalar offsets
  };
  Index pivots = 0;          // scalar
  Index size = 0;            // scalar: pivots and what they update
  std::vector<Index> nodes;  // pivot nodes first (new numbering)
  std::vector<Entry> entries;
  std::vector<Index> children;
  std::vector<Index> to_parent;  // scalar offset in the parent's front of each update block
};

enum class Ordering { best, minimum_degree, nested_dissection };

/// Whether the build has METIS.
bool has_nested_dissection();

struct Fronts {
  Fronts() = default;
  /// The pattern is not kept. A small system is one front. Nested dissection is minimum degree
  /// where the build has none.
  explicit Fronts(const BlockPattern& pattern, Ordering ordering = Ordering::best);

  int d = 1;
  Index size = 0;                                ///< of the matrix, scalar
  Index largest = 0;                             ///< front, scalar
  double flops = 0;                              ///< multiplications of an LU factorisation
  double memory = 0;                             ///< numbers that it keeps
  std::vector<Index> position;                   ///< of each node in the new numbering
  std::vector<Front> fronts;                     ///< children before parents
  Ordering ordering = Ordering::minimum_degree;  ///< that was taken
};

/// The symbolic factorisation of this pattern: the one made before, where this thread had the same
/// pattern among its last few. Successive steps of a simulation often have.
std::shared_ptr<const Fronts> analysed(const BlockPattern& pattern);

}  // namespace fclib
