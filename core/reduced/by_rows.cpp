#include "reduced/by_rows.hpp"

#include <limits>

#include "linalg/with_dimension.hpp"
#include "reduced/relative_error.hpp"
#include "reduced/with_cone.hpp"

namespace fclib {

Matrix by_rows(const BlockMatrix& blocks) {
  const int d = blocks.block_size();
  const auto rows = static_cast<std::size_t>(blocks.block_count());
  const auto square = static_cast<std::size_t>(d) * static_cast<std::size_t>(d);
  const auto size = [](Index k) { return static_cast<std::size_t>(k); };
  Matrix a{.storage = Storage::csr, .rows = d * blocks.block_count()};
  a.cols = a.rows;
  with_dimension(d, [&]<int D>(std::integral_constant<int, D>) {
    std::vector<std::size_t> first(rows + 1, 0);
    blocks.for_each_block<D>([&](Index row, Index, const auto&) { ++first[size(row) + 1]; });
    for (std::size_t row = 0; row < rows; ++row) first[row + 1] += first[row];
    a.p.push_back(0);
    for (std::size_t row = 0; row < rows; ++row) {
      const auto length = static_cast<Index>(first[row + 1] - first[row]);
      for (int k = 0; k < D; ++k) a.p.push_back(a.p.back() + D * length);
    }
    a.i.resize(square * first[rows]);
    a.x.resize(square * first[rows]);
    std::vector<std::size_t> done(rows, 0);
    blocks.for_each_block<D>([&](Index row, Index col, const auto& block) {
      const std::size_t position = D * done[size(row)]++;
      for (int k = 0; k < D; ++k) {
        const std::size_t start = size(a.p[size(D * row + k)]) + position;
        for (int c = 0; c < D; ++c) {
          a.i[start + static_cast<std::size_t>(c)] = D * col + c;
          a.x[start + static_cast<std::size_t>(c)] = block(k, c);
        }
      }
    });
  });
  return a;
}

double error_of(const ReducedProblem& problem, const Vector& r) {
  if (!r.allFinite()) return std::numeric_limits<double>::infinity();
  Vector u(problem.m());
  problem.velocity(r, u);
  return with_cone(problem, [&]<class Cone>() { return relative_error<Cone>(problem, u, r); });
}

}  // namespace fclib
