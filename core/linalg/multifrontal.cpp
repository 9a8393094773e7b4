#include "linalg/multifrontal.hpp"

#include <algorithm>
#include <cmath>

namespace fclib {

Multifrontal::Multifrontal(const BlockPattern& pattern)
    : plan_(pattern), factors_(plan_.fronts.size()) {
  for (std::size_t f = 0; f < factors_.size(); ++f) {
    factors_[f].exchanged.resize(static_cast<std::size_t>(plan_.fronts[f].pivots));
  }
  work_.resize(plan_.largest, plan_.largest);
  permuted_.resize(plan_.size);
  local_.resize(plan_.largest);
}

bool Multifrontal::factorise_pivots(Eigen::Ref<Dense> a, std::vector<Index>& exchanged,
                                    double tiny) {
  // right-looking by panels; the trailing update is a matrix product
  constexpr Index panel = 24;
  const auto n = static_cast<Index>(a.rows());
  for (Index start = 0; start < n; start += panel) {
    const Index width = std::min(panel, n - start);
    const Index end = start + width;
    for (Index k = start; k < end; ++k) {
      Index best = k;
      double largest = 0;
      for (Index row = k; row < n; ++row) {
        const double value = std::abs(a(row, k));
        if (value > largest) {
          largest = value;
          best = row;
        }
      }
      if (!(largest < std::numeric_limits<double>::infinity())) return false;
      exchanged[static_cast<std::size_t>(k)] = best;
      if (best != k) a.row(k).swap(a.row(best));
      if (largest <= tiny) a(k, k) = a(k, k) < 0 ? -tiny : tiny;
      const double inverse = 1.0 / a(k, k);
      for (Index row = k + 1; row < n; ++row) a(row, k) *= inverse;
      for (Index col = k + 1; col < end; ++col) {
        const double factor = a(k, col);
        if (factor == 0) continue;
        for (Index row = k + 1; row < n; ++row) a(row, col) -= a(row, k) * factor;
      }
    }
    if (end == n) break;
    const Index rest = n - end;
    a.block(start, start, width, width)
        .triangularView<Eigen::UnitLower>()
        .solveInPlace(a.block(start, end, width, rest));
    a.block(end, end, rest, rest).noalias() -=
        a.block(end, start, rest, width) * a.block(start, end, width, rest);
  }
  return true;
}

bool Multifrontal::factorise(const std::vector<double>& values) {
  const int d = plan_.d;
  const std::size_t block_size = static_cast<std::size_t>(d) * static_cast<std::size_t>(d);
  const Eigen::Map<const Vector> all(values.data(), static_cast<Eigen::Index>(values.size()));
  if (!all.allFinite()) return false;
  const double largest = values.empty() ? 0 : all.lpNorm<Eigen::Infinity>();
  const double tiny = 1e-18 * largest;
  for (std::size_t f = 0; f < factors_.size(); ++f) {
    const Front& front = plan_.fronts[f];
    Factors& factors = factors_[f];
    auto a = work_.topLeftCorner(front.size, front.size);
    a.setZero();
    for (const Front::Entry& entry : front.entries) {
      const double* block = values.data() + block_size * static_cast<std::size_t>(entry.block);
      for (int c = 0; c < d; ++c) {
        for (int r = 0; r < d; ++r) a(entry.row + r, entry.col + c) += block[d * c + r];
      }
    }
    for (const Index child : front.children) {
      const std::vector<Index>& to_parent = plan_.fronts[child].to_parent;
      Factors& from = factors_[child];
      const auto blocks = static_cast<Index>(to_parent.size());
      for (Index cb = 0; cb < blocks; ++cb) {
        for (int c = 0; c < d; ++c) {
          const double* source = from.update.data() + std::ptrdiff_t{d * cb + c} * d * blocks;
          double* target = &a(0, to_parent[cb] + c);
          for (Index rb = 0; rb < blocks; ++rb) {
            for (int r = 0; r < d; ++r) target[to_parent[rb] + r] += source[d * rb + r];
          }
        }
      }
      from.update.resize(0, 0);
    }
    const Index k = front.pivots;
    const Index u = front.size - k;
    factors.diagonal = a.topLeftCorner(k, k);
    if (!factorise_pivots(factors.diagonal, factors.exchanged, tiny)) return false;
    if (u == 0) continue;
    factors.upper = a.topRightCorner(k, u);
    for (Index row = 0; row < k; ++row) {
      const Index other = factors.exchanged[static_cast<std::size_t>(row)];
      if (other != row) factors.upper.row(row).swap(factors.upper.row(other));
    }
    factors.diagonal.triangularView<Eigen::UnitLower>().solveInPlace(factors.upper);
    factors.lower = a.bottomLeftCorner(u, k);
    factors.diagonal.triangularView<Eigen::Upper>().solveInPlace<Eigen::OnTheRight>(factors.lower);
    factors.update = a.bottomRightCorner(u, u);
    factors.update.noalias() -= factors.lower * factors.upper;
  }
  return true;
}

int Multifrontal::determinant_sign() const {
  bool negative = false;
  for (const Factors& factors : factors_) {
    for (Index k = 0; k < factors.diagonal.rows(); ++k) {
      if (factors.diagonal(k, k) < 0) negative = !negative;
      if (factors.exchanged[static_cast<std::size_t>(k)] != k) negative = !negative;
    }
  }
  return negative ? -1 : 1;
}

void Multifrontal::solve(Vector& b) const {
  const int d = plan_.d;
  const std::vector<Index>& position = plan_.position;
  const Index n = static_cast<Index>(position.size());
  for (Index node = 0; node < n; ++node) {
    for (int c = 0; c < d; ++c) permuted_[d * position[node] + c] = b[d * node + c];
  }
  const auto gather = [&](const Front& front) {
    for (std::size_t k = 0; k < front.nodes.size(); ++k) {
      for (int c = 0; c < d; ++c)
        local_[d * static_cast<Index>(k) + c] = permuted_[d * front.nodes[k] + c];
    }
  };
  const auto scatter = [&](const Front& front) {
    for (std::size_t k = 0; k < front.nodes.size(); ++k) {
      for (int c = 0; c < d; ++c)
        permuted_[d * front.nodes[k] + c] = local_[d * static_cast<Index>(k) + c];
    }
  };
  for (std::size_t f = 0; f < factors_.size(); ++f) {
    const Front& front = plan_.fronts[f];
    const Factors& factors = factors_[f];
    const Index u = front.size - front.pivots;
    gather(front);
    auto top = local_.head(front.pivots);
    for (Index k = 0; k < front.pivots; ++k) {
      const Index other = factors.exchanged[static_cast<std::size_t>(k)];
      if (other != k) std::swap(top[k], top[other]);
    }
    factors.diagonal.triangularView<Eigen::UnitLower>().solveInPlace(top);
    if (u > 0) local_.segment(front.pivots, u).noalias() -= factors.lower * top;
    scatter(front);
  }
  for (std::size_t f = factors_.size(); f-- > 0;) {
    const Front& front = plan_.fronts[f];
    const Factors& factors = factors_[f];
    const Index u = front.size - front.pivots;
    gather(front);
    auto top = local_.head(front.pivots);
    if (u > 0) top.noalias() -= factors.upper * local_.segment(front.pivots, u);
    factors.diagonal.triangularView<Eigen::Upper>().solveInPlace(top);
    scatter(front);
  }
  for (Index node = 0; node < n; ++node) {
    for (int c = 0; c < d; ++c) b[d * node + c] = permuted_[d * position[node] + c];
  }
}

}  // namespace fclib
