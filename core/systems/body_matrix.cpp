#include "systems/body_matrix.hpp"

#include <algorithm>
#include <numeric>
#include <span>

#include "linalg/with_dimension.hpp"

namespace fclib {

namespace {

/// The bodies are tried only if a contact touches few of their coordinates.
constexpr std::int64_t most_rows = 64;

template <int D>
using Rows = Eigen::Matrix<double, Eigen::Dynamic, D, 0, most_rows, D>;

template <class F>
void on_each(Workers* workers, const F& f) {
  if (workers == nullptr) return f(0);
  workers->run([&](int k) { f(k); });
}

}  // namespace

void BodyMatrix::collect_rows(const SparseColumns& H) {
  row_first_.assign(1, 0);
  row_.clear();
  for (Eigen::Index col = 0; col < H.cols(); col += d_) {
    const auto own = static_cast<std::ptrdiff_t>(row_.size());
    for (int c = 0; c < d_; ++c) {
      for (SparseColumns::InnerIterator at(H, col + c); at; ++at)
        row_.push_back(static_cast<Index>(at.row()));
    }
    std::sort(row_.begin() + own, row_.end());
    row_.erase(std::unique(row_.begin() + own, row_.end()), row_.end());
    row_first_.push_back(static_cast<std::int64_t>(row_.size()));
  }
}

void BodyMatrix::copy_columns(const SparseColumns& H) {
  h_.assign(row_.size() * static_cast<std::size_t>(d_), 0.0);
  for (Index a = 0; a < contacts(); ++a) {
    const auto begin = row_.begin() + row_first_[a];
    const auto end = row_.begin() + row_first_[a + 1];
    double* h = h_.data() + d_ * row_first_[a];
    for (int c = 0; c < d_; ++c, h += end - begin) {
      for (SparseColumns::InnerIterator at(H, Eigen::Index{d_} * a + c); at; ++at)
        h[std::lower_bound(begin, end, at.row()) - begin] += at.value();
    }
  }
}

std::optional<BlockPattern> BodyMatrix::analyse(const Primal& primal, int d) {
  d_ = d;
  size_ = static_cast<Index>(primal.M.rows());
  collect_rows(primal.H);
  for (Index a = 0; a < contacts(); ++a) {
    if (row_first_[a + 1] - row_first_[a] > most_rows) return std::nullopt;
  }
  copy_columns(primal.H);

  // the contacts that touch each coordinate
  const auto count = static_cast<std::size_t>(size_);
  std::vector<std::int64_t> touch_first(count + 1, 0);
  for (const Index row : row_) ++touch_first[row + 1];
  std::partial_sum(touch_first.begin(), touch_first.end(), touch_first.begin());
  std::vector<Index> touching(row_.size());
  std::vector<std::int64_t> next(touch_first.begin(), touch_first.end() - 1);
  for (Index a = 0; a < contacts(); ++a) {
    for (auto k = row_first_[a]; k < row_first_[a + 1]; ++k) touching[next[row_[k]]++] = a;
  }
  const auto touching_of = [&](Index row) {
    return std::span(touching).subspan(
        static_cast<std::size_t>(touch_first[row]),
        static_cast<std::size_t>(touch_first[row + 1] - touch_first[row]));
  };
  const SparseColumns transposed = primal.M.transpose();

  BlockPattern pattern;
  pattern.first.assign(1, 0);
  fixed_.clear();
  place_first_.assign(1, 0);
  for (Index a = 0; a < contacts(); ++a) {
    const auto rows = row_first_[a + 1] - row_first_[a];
    place_first_.push_back(place_first_.back() + rows * rows);
  }
  place_.resize(static_cast<std::size_t>(place_first_.back()));
  std::vector<Index> seen(count, -1);               // the last column that has the row
  std::vector<std::int64_t> where(count);           // place of the row in that column
  std::vector<Index> placed(row_first_.size(), 0);  // columns of each contact
  for (Index col = 0; col < size_; ++col) {
    const auto begin = static_cast<std::ptrdiff_t>(pattern.row.size());
    const auto add = [&](Index row) {
      if (seen[row] == col) return;
      seen[row] = col;
      pattern.row.push_back(row);
    };
    add(col);
    for (const Index a : touching_of(col)) {
      std::for_each(row_.begin() + row_first_[a], row_.begin() + row_first_[a + 1], add);
    }
    for (const SparseColumns* m : {&primal.M, &transposed}) {
      for (SparseColumns::InnerIterator at(*m, col); at; ++at) add(static_cast<Index>(at.row()));
    }
    std::sort(pattern.row.begin() + begin, pattern.row.end());
    pattern.first.push_back(static_cast<std::int64_t>(pattern.row.size()));
    for (auto k = pattern.first[col]; k < pattern.first[col + 1]; ++k) where[pattern.row[k]] = k;
    fixed_.resize(pattern.row.size(), 0.0);
    for (SparseColumns::InnerIterator at(primal.M, col); at; ++at) {
      fixed_[where[at.row()]] += at.value();
    }
    for (const Index a : touching_of(col)) {
      const auto rows = row_first_[a + 1] - row_first_[a];
      std::int64_t* place = place_.data() + place_first_[a] + rows * placed[a]++;
      for (auto k = row_first_[a]; k < row_first_[a + 1]; ++k) *place++ = where[row_[k]];
    }
  }
  column_first_ = pattern.first;
  share_out(1);
  return pattern;
}

void BodyMatrix::share_out(int threads) {
  // cut so that each has the same number of entries of the products
  std::vector<std::int64_t> entries(static_cast<std::size_t>(size_) + 1, 0);
  for (Index a = 0; a < contacts(); ++a) {
    for (auto k = row_first_[a]; k < row_first_[a + 1]; ++k)
      entries[row_[k] + 1] += row_first_[a + 1] - row_first_[a];
  }
  for (Index row = 0; row < size_; ++row) entries[row + 1] += entries[row];
  bounds_.assign(1, 0);
  for (int k = 1; k < threads; ++k) {
    const auto cut = std::lower_bound(entries.begin(), entries.end(), k * entries.back() / threads);
    bounds_.push_back(std::max(bounds_.back(), static_cast<Index>(cut - entries.begin())));
  }
  bounds_.push_back(size_);
  reach_.clear();
  if (threads == 1) return;
  reach_.resize(static_cast<std::size_t>(threads));
  for (Index a = 0; a < contacts(); ++a) {
    for (auto k = row_first_[a]; k < row_first_[a + 1]; ++k) {
      const auto part = std::upper_bound(bounds_.begin(), bounds_.end() - 1, row_[k]);
      auto& reach = reach_[static_cast<std::size_t>(part - bounds_.begin()) - 1];
      if (reach.empty() || reach.back() != a) reach.push_back(a);
    }
  }
}

template <class F>
void BodyMatrix::each_of_part(int part, const F& f) const {
  const auto k = static_cast<std::size_t>(part);
  if (reach_.empty()) {
    for (Index a = 0; a < contacts(); ++a) f(a, bounds_[k], bounds_[k + 1]);
  } else {
    for (const Index a : reach_[k]) f(a, bounds_[k], bounds_[k + 1]);
  }
}

void BodyMatrix::fill(const std::vector<double>& blocks, std::vector<double>& values,
                      Workers* workers) const {
  values.resize(fixed_.size());
  with_dimension(d_, [&](auto D) {
    on_each(workers, [&](int part) {
      const auto begin = column_first_[bounds_[part]];
      const auto end = column_first_[bounds_[part + 1]];
      std::copy(fixed_.begin() + begin, fixed_.begin() + end, values.begin() + begin);
      Rows<D> product;
      each_of_part(part, [&](Index a, Index first, Index last) {
        const auto count = static_cast<Eigen::Index>(row_first_[a + 1] - row_first_[a]);
        const Index* rows = row_.data() + row_first_[a];
        const Eigen::Map<const Rows<D>> h(h_.data() + D * row_first_[a], count, D);
        const double* block = blocks.data() + std::ptrdiff_t{D * D} * a;
        product.noalias() = h * Eigen::Map<const Eigen::Matrix<double, D, D>>(block);
        const std::int64_t* place = place_.data() + place_first_[a];
        for (Eigen::Index col = 0; col < count; ++col, place += count) {
          if (rows[col] < first || rows[col] >= last) continue;
          for (Eigen::Index row = 0; row < count; ++row) {
            double sum = product(row, 0) * h(col, 0);
            for (int c = 1; c < D; ++c) sum += product(row, c) * h(col, c);
            values[place[row]] += sum;
          }
        }
      });
    });
  });
}

void BodyMatrix::to_bodies(const Vector& x, Vector& y, Workers* workers) const {
  y.resize(size_);
  on_each(workers, [&](int part) {
    y.segment(bounds_[part], bounds_[part + 1] - bounds_[part]).setZero();
    each_of_part(part, [&](Index a, Index first, Index last) {
      const double* h = h_.data() + d_ * row_first_[a];
      for (int c = 0; c < d_; ++c) {
        const double value = x[Eigen::Index{d_} * a + c];
        for (auto k = row_first_[a]; k < row_first_[a + 1]; ++k) {
          if (row_[k] >= first && row_[k] < last) y[row_[k]] += *h * value;
          ++h;
        }
      }
    });
  });
}

void BodyMatrix::subtract_from_contacts(const std::vector<double>& blocks, const Vector& y,
                                        Vector& x, Workers* workers) const {
  with_dimension(d_, [&](auto D) {
    using Block = Eigen::Matrix<double, D, D>;
    in_parts(workers, contacts(), [&](std::int64_t first, std::int64_t last) {
      for (auto a = first; a < last; ++a) {
        Eigen::Matrix<double, D, 1> velocity = Eigen::Matrix<double, D, 1>::Zero();
        const double* h = h_.data() + D * row_first_[a];
        for (int c = 0; c < D; ++c) {
          for (auto k = row_first_[a]; k < row_first_[a + 1]; ++k) velocity[c] += *h++ * y[row_[k]];
        }
        x.segment<D>(D * a) -= Eigen::Map<const Block>(blocks.data() + D * D * a) * velocity;
      }
    });
  });
}

}  // namespace fclib
