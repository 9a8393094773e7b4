#include "linalg/block_matrix.hpp"

#include <algorithm>

#include "linalg/groups.hpp"
#include "linalg/with_dimension.hpp"

namespace fclib {

namespace {
// with at least this share of the blocks, a dense column costs less than a gather over blocks
constexpr double dense_share = 0.6;
// ... and the dense matrix stays about inside the first-level cache
constexpr std::size_t dense_limit = 128;
}  // namespace

BlockMatrix::BlockMatrix(const Matrix& a, int d) : d_(d), nc_(a.rows / d) {
  with_dimension(d, [&](auto D) { fill<D>(a); });
}

template <int D>
void BlockMatrix::fill(const Matrix& a) {
  const auto nc = static_cast<std::size_t>(nc_);
  const Matrix columns = a.storage == Storage::csc || a.storage == Storage::dense
                             ? Matrix{}
                             : converted(a, Storage::csc);
  const Matrix& source = columns.empty() ? a : columns;
  const auto entries_of = [&](Index col, auto&& visit) {
    if (source.storage == Storage::dense) {
      const double* first = source.x.data() + static_cast<std::size_t>(col) * source.rows;
      for (Index row = 0; row < source.rows; ++row) {
        if (first[row] != 0) visit(row, first[row]);
      }
    } else {
      for (Index k = source.p[col]; k < source.p[col + 1]; ++k) visit(source.i[k], source.x[k]);
    }
  };

  // one contact has one block
  if (nc == 1) {
    dense_ = true;
    values_.assign(D * D, 0.0);
    for (Index col = 0; col < D; ++col) {
      entries_of(col, [&](Index row, double value) { values_[D * col + row] += value; });
    }
    return;
  }

  // the pattern of blocks, always with the diagonal one
  std::vector<Index> last_seen(nc, -1);
  column_.reserve(nc + 1);
  column_.assign(1, 0);
  diagonal_.resize(nc);
  for (Index contact = 0; contact < nc_; ++contact) {
    const auto first = row_.size();
    last_seen[contact] = contact;
    row_.push_back(contact);
    for (int c = 0; c < D; ++c) {
      entries_of(D * contact + c, [&](Index row, double) {
        const Index block_row = row / D;
        if (last_seen[block_row] != contact) {
          last_seen[block_row] = contact;
          row_.push_back(block_row);
        }
      });
    }
    std::sort(row_.begin() + static_cast<std::ptrdiff_t>(first), row_.end());
    const auto at =
        std::lower_bound(row_.begin() + static_cast<std::ptrdiff_t>(first), row_.end(), contact);
    diagonal_[contact] = static_cast<std::size_t>(at - row_.begin());
    column_.push_back(row_.size());
  }

  dense_ = nc <= dense_limit && static_cast<double>(row_.size()) >=
                                    dense_share * static_cast<double>(nc) * static_cast<double>(nc);
  if (dense_) {
    const std::size_t m = D * nc;
    values_.assign(m * m, 0.0);
    for (Index col = 0; col < D * nc_; ++col) {
      entries_of(col, [&](Index row, double value) { values_[m * col + row] += value; });
    }
    return;
  }
  values_.assign(D * D * row_.size(), 0.0);
  std::vector<std::size_t> position(nc);
  for (Index contact = 0; contact < nc_; ++contact) {
    for (auto k = column_[contact]; k < column_[contact + 1]; ++k) position[row_[k]] = k;
    for (int c = 0; c < D; ++c) {
      entries_of(D * contact + c, [&](Index row, double value) {
        values_[D * D * position[row / D] + D * c + row % D] += value;
      });
    }
  }
}

template <int D>
void BlockMatrix::multiply_rows(Index first, Index last, const Vector& x, const Vector& q,
                                Vector& y) const {
  y.segment(Eigen::Index{D} * first, Eigen::Index{D} * (last - first)) =
      q.segment(Eigen::Index{D} * first, Eigen::Index{D} * (last - first));
  for (Index contact = 0; contact < nc_; ++contact) {
    std::size_t begin = column_[contact];
    std::size_t end = column_[contact + 1];
    if (row_[end - 1] < first || row_[begin] >= last) continue;
    double part[D];
    bool zero = true;
    for (int c = 0; c < D; ++c) {
      part[c] = x[Eigen::Index{D} * contact + c];
      zero = zero && part[c] == 0;
    }
    if (zero) continue;
    while (row_[begin] < first) ++begin;
    while (row_[end - 1] >= last) --end;
    add_blocks<D>(begin, end, part, y.data());
  }
}

void BlockMatrix::multiply_add(const Vector& x, const Vector& q, Vector& y,
                               Workers* workers) const {
  if (workers != nullptr && !dense_) {
    y.resize(q.size());
    return in_parts(workers, nc_, [&](std::int64_t from, std::int64_t to) {
      const auto first = static_cast<Index>(from);
      const auto last = static_cast<Index>(to);
      with_dimension(d_, [&](auto D) { multiply_rows<D>(first, last, x, q, y); });
    });
  }
  y = q;
  for (Index contact = 0; contact < nc_; ++contact) {
    const double* part = x.data() + std::ptrdiff_t{d_} * contact;
    if (std::all_of(part, part + d_, [](double value) { return value == 0; })) continue;
    with_dimension(d_, [&](auto D) { add_column<D>(contact, part, y.data()); });
  }
}

std::vector<Index> BlockMatrix::components() const {
  if (dense_) return std::vector<Index>(static_cast<std::size_t>(nc_), 0);
  // the pattern may be unsymmetric: all blocks link
  Groups groups(nc_);
  for (Index col = 0; col < nc_; ++col) {
    for (std::size_t k = column_[col]; k < column_[col + 1]; ++k) groups.link(row_[k], col);
  }
  return groups.numbers();
}

BlockMatrix BlockMatrix::scaled(const Vector& factors) const {
  BlockMatrix result = *this;
  if (dense_) {
    const Eigen::Index m = Eigen::Index{d_} * nc_;
    Eigen::Map<Eigen::MatrixXd> all(result.values_.data(), m, m);
    all = factors.asDiagonal() * all * factors.asDiagonal();
    return result;
  }
  double* values = result.values_.data();
  for (Index col = 0; col < nc_; ++col) {
    const auto by = factors.segment(Eigen::Index{d_} * col, d_);
    for (std::size_t k = column_[col]; k < column_[col + 1]; ++k, values += d_ * d_) {
      Eigen::Map<Eigen::MatrixXd> block(values, d_, d_);
      block =
          factors.segment(Eigen::Index{d_} * row_[k], d_).asDiagonal() * block * by.asDiagonal();
    }
  }
  return result;
}

BlockMatrix BlockMatrix::restricted(const std::vector<Index>& contacts) const {
  BlockMatrix result;
  result.d_ = d_;
  result.nc_ = static_cast<Index>(contacts.size());
  const auto block = static_cast<std::size_t>(d_) * static_cast<std::size_t>(d_);
  std::vector<Index> where(static_cast<std::size_t>(nc_), -1);
  for (std::size_t k = 0; k < contacts.size(); ++k) where[contacts[k]] = static_cast<Index>(k);
  result.column_.assign(1, 0);
  for (const Index contact : contacts) {
    for (std::size_t k = column_[contact]; k < column_[contact + 1]; ++k) {
      if (row_[k] == contact) result.diagonal_.push_back(result.row_.size());
      result.row_.push_back(where[row_[k]]);
      const double* values = values_.data() + block * k;
      result.values_.insert(result.values_.end(), values, values + block);
    }
    result.column_.push_back(result.row_.size());
  }
  return result;
}

}  // namespace fclib
