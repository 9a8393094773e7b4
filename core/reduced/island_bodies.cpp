#include "reduced/island_bodies.hpp"

#include <algorithm>

namespace fclib {

namespace {

/// These columns of a matrix, with the rows at their places.
SparseColumns columns_of(const SparseColumns& a, std::span<const Index> columns,
                         std::span<const Index> place, Index rows) {
  SparseColumns part(rows, static_cast<Eigen::Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    part.startVec(column);
    for (SparseColumns::InnerIterator entry(a, columns[k]); entry; ++entry) {
      part.insertBack(place[entry.row()], column) = entry.value();
    }
  }
  part.finalize();
  return part;
}

}  // namespace

IslandBodies::IslandBodies(const Primal& whole)
    : whole_(whole), place_(static_cast<std::size_t>(whole.M.rows()), -1) {}

Primal IslandBodies::of(std::span<const Index> contacts, int d) {
  std::vector<Index> columns;
  for (const Index a : contacts) {
    for (int k = 0; k < d; ++k) columns.push_back(d * a + k);
  }
  std::vector<Index> linked;
  const auto take = [&](const SparseColumns& a, Index column) {
    for (SparseColumns::InnerIterator entry(a, column); entry; ++entry) {
      if (place_[entry.row()] >= 0) continue;
      place_[entry.row()] = 0;
      linked.push_back(static_cast<Index>(entry.row()));
    }
  };
  for (const Index column : columns) take(whole_.H, column);
  for (std::size_t k = 0; k < linked.size(); ++k) take(whole_.M, linked[k]);
  // in their order: coordinates of one body are near each other
  std::sort(linked.begin(), linked.end());
  const auto count = static_cast<Index>(linked.size());
  for (Index k = 0; k < count; ++k) place_[linked[k]] = k;
  Primal part{columns_of(whole_.M, linked, place_, count),
              columns_of(whole_.H, columns, place_, count)};
  for (const Index row : linked) place_[row] = -1;
  return part;
}

}  // namespace fclib
