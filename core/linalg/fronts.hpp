// The symbolic part of a multifrontal factorisation of a matrix whose pattern is symmetric (Duff &
// Reid, "The multifrontal solution of indefinite sparse symmetric linear systems", 1983): an
// ordering of the blocks, and supernodes with relaxed amalgamation. Nothing numeric.
//
// The ordering is by approximate minimum degree. If that leaves many operations and the build has
// METIS, nested dissection (Karypis & Kumar 1998) is used if it takes fewer.
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
  struct Entry {  // one block of A, and its place in its front
    std::int64_t block;
    Index row, col;  // scalar offsets
  };
  struct Run {        // neighbouring rows of the update that are neighbours in the parent's front
    Index to, count;  // scalar
  };
  Index pivots = 0;          // scalar
  Index size = 0;            // scalar: the pivots and the rows that they update
  std::vector<Index> nodes;  // pivot nodes first (new numbering)
  std::vector<Entry> entries;
  std::vector<Index> children;
  std::vector<Index> to_parent;  // scalar offset in the parent's front of each update block
  std::vector<Run> runs;         // the same, for the rows
};

enum class Ordering { best, minimum_degree, nested_dissection };

/// Whether the build has METIS.
bool has_nested_dissection();

struct Fronts {
  Fronts() = default;
  /// The pattern is not kept. A small system is one front. If the build has no nested dissection,
  /// minimum degree stands for it.
  explicit Fronts(const BlockPattern& pattern, Ordering ordering = Ordering::best);

  int d = 1;
  Index size = 0;                                ///< of the matrix, scalar
  Index largest = 0;                             ///< scalar size of the largest front
  double flops = 0;                              ///< multiplications of an LU factorisation
  double memory = 0;                             ///< numbers that it keeps
  std::vector<Index> position;                   ///< of each node in the new numbering
  std::vector<Front> fronts;                     ///< children before parents
  Ordering ordering = Ordering::minimum_degree;  ///< the ordering that was used
};

/// The symbolic factorisation of this pattern. If this thread had the same pattern among its last
/// few, it is the one made then. Successive steps of a simulation often have the same pattern.
std::shared_ptr<const Fronts> analysed(const BlockPattern& pattern);

}  // namespace fclib
