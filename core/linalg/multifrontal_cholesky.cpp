#include "linalg/multifrontal_cholesky.hpp"

#include <algorithm>
#include <limits>

namespace fclib {

namespace {

/// The clock is read after so many columns of a product.
constexpr Eigen::Index columns_at_once = 256;

/// sum += y^T y, the lower triangle. Returns false if the deadline passes meanwhile.
bool add_gram(Eigen::MatrixXd& sum, const Eigen::Ref<const Eigen::MatrixXd>& y,
              const Deadline& deadline) {
  const Eigen::Index size = y.cols();
  for (Eigen::Index col = 0; col < size; col += columns_at_once) {
    if (col > 0 && deadline.passed()) return false;
    const Eigen::Index count = std::min(columns_at_once, size - col);
    const Eigen::Index below = size - col - count;
    const auto some = y.middleCols(col, count);
    sum.block(col, col, count, count).selfadjointView<Eigen::Lower>().rankUpdate(some.transpose());
    if (below > 0) {
      sum.block(col + count, col, below, count).noalias() += y.rightCols(below).transpose() * some;
    }
  }
  return true;
}

}  // namespace

BlockPattern MultifrontalCholesky::symmetric_pattern(const SparseColumns& a) {
  BlockPattern pattern;
  pattern.first.assign(1, 0);
  pattern.row.reserve(static_cast<std::size_t>(a.nonZeros()));
  for (Eigen::Index col = 0; col < a.cols(); ++col) {
    for (SparseColumns::InnerIterator at(a, col); at; ++at) {
      pattern.row.push_back(static_cast<Index>(at.row()));
    }
    pattern.first.push_back(static_cast<std::int64_t>(pattern.row.size()));
  }
  return pattern;
}

MultifrontalCholesky::MultifrontalCholesky(Fronts symbolic, const SparseColumns& a)
    : symbolic_(std::move(symbolic)), factors_(symbolic_.fronts.size()) {
  positive_definite_ = factorise(a);
}

bool MultifrontalCholesky::factorise(const SparseColumns& a) {
  Dense work(symbolic_.largest, symbolic_.largest);
  std::vector<Dense> updates(factors_.size());  // lower triangles, until the parent has taken them
  for (std::size_t f = 0; f < factors_.size(); ++f) {
    const Front& front = symbolic_.fronts[f];
    const Index k = front.pivots;
    const Index u = front.size - k;
    auto front_matrix = work.topLeftCorner(front.size, front.size);
    front_matrix.setZero();
    for (const Front::Entry& entry : front.entries) {
      if (entry.row >= entry.col) front_matrix(entry.row, entry.col) += a.valuePtr()[entry.block];
    }
    for (const Index child : front.children) {
      const std::vector<Index>& to = symbolic_.fronts[child].to_parent;
      Dense& update = updates[child];
      for (std::size_t col = 0; col < to.size(); ++col) {
        const double* source = update.data() + static_cast<std::ptrdiff_t>(col * to.size());
        double* target = &front_matrix(0, to[col]);
        for (std::size_t row = col; row < to.size(); ++row) target[to[row]] += source[row];
      }
      update.resize(0, 0);
    }
    Factors& factors = factors_[f];
    factors.diagonal = front_matrix.topLeftCorner(k, k);
    const Eigen::LLT<Eigen::Ref<Dense>> pivots(factors.diagonal);
    if (pivots.info() != Eigen::Success) return false;
    if (u == 0) continue;
    factors.lower = front_matrix.bottomLeftCorner(u, k);
    factors.diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(
        factors.lower);
    updates[f] = front_matrix.bottomRightCorner(u, u);
    updates[f].selfadjointView<Eigen::Lower>().rankUpdate(factors.lower, -1.0);
  }
  return true;
}

Vector MultifrontalCholesky::solve(ConstVectorRef b) const {
  Vector permuted(b.size());
  for (Index node = 0; node < symbolic_.size; ++node) permuted[symbolic_.position[node]] = b[node];
  Vector local(symbolic_.largest);
  const auto gather = [&](const Front& front) {
    for (std::size_t k = 0; k < front.nodes.size(); ++k) local[k] = permuted[front.nodes[k]];
  };
  const auto scatter = [&](const Front& front) {
    for (std::size_t k = 0; k < front.nodes.size(); ++k) permuted[front.nodes[k]] = local[k];
  };
  for (std::size_t f = 0; f < factors_.size(); ++f) {
    const Front& front = symbolic_.fronts[f];
    const Index u = front.size - front.pivots;
    gather(front);
    auto top = local.head(front.pivots);
    factors_[f].diagonal.triangularView<Eigen::Lower>().solveInPlace(top);
    if (u > 0) local.segment(front.pivots, u).noalias() -= factors_[f].lower * top;
    scatter(front);
  }
  for (std::size_t f = factors_.size(); f-- > 0;) {
    const Front& front = symbolic_.fronts[f];
    const Index u = front.size - front.pivots;
    gather(front);
    auto top = local.head(front.pivots);
    if (u > 0) {
      top.noalias() -= factors_[f].lower.transpose() * local.segment(front.pivots, u);
    }
    factors_[f].diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace(top);
    scatter(front);
  }
  Vector result(b.size());
  for (Index node = 0; node < symbolic_.size; ++node)
    result[node] = permuted[symbolic_.position[node]];
  return result;
}

Vector MultifrontalCholesky::terms(ConstVectorRef x) const {
  Vector permuted(x.size());
  for (Index node = 0; node < symbolic_.size; ++node) permuted[symbolic_.position[node]] = x[node];
  Vector sizes = Vector::Zero(x.size());
  for (std::size_t f = 0; f < factors_.size(); ++f) {
    const Front& front = symbolic_.fronts[f];
    const Index below = front.size - front.pivots;
    Vector local(front.size);
    for (Index k = 0; k < front.size; ++k) local[k] = permuted[front.nodes[k]];
    const Dense lower = factors_[f].diagonal.triangularView<Eigen::Lower>();
    Vector sums = lower.transpose() * local.head(front.pivots);
    if (below > 0) sums += factors_[f].lower.transpose() * local.tail(below);
    local.head(front.pivots) = lower.cwiseAbs() * sums.cwiseAbs();
    if (below > 0) local.tail(below) = factors_[f].lower.cwiseAbs() * sums.cwiseAbs();
    for (Index k = 0; k < front.size; ++k) sizes[front.nodes[k]] += local[k];
  }
  Vector result(x.size());
  for (Index node = 0; node < symbolic_.size; ++node)
    result[node] = sizes[symbolic_.position[node]];
  return result;
}

std::vector<Index> MultifrontalCholesky::roots() const {
  std::vector<Index> root(factors_.size());
  for (std::size_t f = factors_.size(); f-- > 0;) {
    if (symbolic_.fronts[f].to_parent.empty()) root[f] = static_cast<Index>(f);
    for (const Index child : symbolic_.fronts[f].children) root[child] = root[f];
  }
  return root;
}

/// Y = L^-1 P B, front by front. visit(front, columns, rows of Y at its pivots) gets only the
/// columns of B that reach the front, in ascending order. Returns false if the visitor returns
/// false or the deadline has passed; the deadline is checked at every front and every
/// `columns_at_once` of its columns.
template <class Visit>
bool MultifrontalCholesky::forward(const SparseColumns& b, const Deadline& deadline,
                                   const Visit& visit) const {
  struct Part {  // rows of B, updated, below the pivots of a front
    std::vector<Index> columns;
    Dense values;
  };
  const Eigen::SparseMatrix<double, Eigen::RowMajor, Index> rows = b;
  std::vector<Index> node_of(static_cast<std::size_t>(symbolic_.size));  // in the old numbering
  for (Index node = 0; node < symbolic_.size; ++node) node_of[symbolic_.position[node]] = node;
  std::vector<Part> parts(factors_.size());
  std::vector<Index> place(static_cast<std::size_t>(b.cols()));
  Dense work;
  for (std::size_t f = 0; f < factors_.size(); ++f) {
    if (deadline.passed()) return false;
    const Front& front = symbolic_.fronts[f];
    const Index k = front.pivots;
    const Index u = front.size - k;
    std::vector<Index> columns;
    for (Index p = 0; p < k; ++p) {
      for (decltype(rows)::InnerIterator at(rows, node_of[front.nodes[p]]); at; ++at)
        columns.push_back(static_cast<Index>(at.col()));
    }
    for (const Index child : front.children) {
      columns.insert(columns.end(), parts[child].columns.begin(), parts[child].columns.end());
    }
    std::sort(columns.begin(), columns.end());
    columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
    if (columns.empty()) continue;
    for (std::size_t c = 0; c < columns.size(); ++c) place[columns[c]] = static_cast<Index>(c);
    work.setZero(front.size, static_cast<Eigen::Index>(columns.size()));
    for (Index p = 0; p < k; ++p) {
      for (decltype(rows)::InnerIterator at(rows, node_of[front.nodes[p]]); at; ++at)
        work(p, place[at.col()]) = at.value();
    }
    for (const Index child : front.children) {
      const std::vector<Index>& to = symbolic_.fronts[child].to_parent;
      Part& part = parts[child];
      for (std::size_t c = 0; c < part.columns.size(); ++c) {
        const double* source = part.values.data() + static_cast<std::ptrdiff_t>(c * to.size());
        double* target = &work(0, place[part.columns[c]]);
        for (std::size_t row = 0; row < to.size(); ++row) target[to[row]] += source[row];
      }
      part = {};
    }
    auto y = work.topRows(k);
    const Eigen::Index count = y.cols();
    for (Eigen::Index col = 0; col < count; col += columns_at_once) {
      if (col > 0 && deadline.passed()) return false;
      auto some = y.middleCols(col, std::min(columns_at_once, count - col));
      factors_[f].diagonal.triangularView<Eigen::Lower>().solveInPlace(some);
    }
    if (u > 0) {
      parts[f].values = work.bottomRows(u);
      parts[f].values.noalias() -= factors_[f].lower * y;
    }
    if (!visit(f, columns, y)) return false;
    if (u > 0) parts[f].columns = std::move(columns);
  }
  return true;
}

std::optional<SparseColumns> MultifrontalCholesky::gram(const SparseColumns& b,
                                                        const Deadline& deadline) const {
  // Y^T Y of each tree of fronts, dense in the columns that reach the tree
  const std::vector<Index> root = roots();
  std::vector<std::vector<Index>> reaching(factors_.size());
  std::vector<Index> front_of(static_cast<std::size_t>(symbolic_.size));
  for (std::size_t f = 0; f < factors_.size(); ++f) {
    for (Index p = 0; p < symbolic_.fronts[f].pivots; ++p)
      front_of[symbolic_.fronts[f].nodes[p]] = static_cast<Index>(f);
  }
  for (Eigen::Index col = 0; col < b.cols(); ++col) {
    for (SparseColumns::InnerIterator at(b, col); at; ++at) {
      auto& columns = reaching[root[front_of[symbolic_.position[at.row()]]]];
      if (columns.empty() || columns.back() != col) columns.push_back(static_cast<Index>(col));
    }
  }

  std::vector<Eigen::Triplet<double, Index>> entries;
  std::vector<Index> place(static_cast<std::size_t>(b.cols()));
  Dense tree;
  Dense part;
  Index last = -1;  // the tree whose columns have places now
  const bool whole =
      forward(b, deadline, [&](std::size_t f, const std::vector<Index>& columns, const auto& y) {
        const std::vector<Index>& all = reaching[root[f]];
        if (last != root[f]) {
          last = root[f];
          for (std::size_t c = 0; c < all.size(); ++c) place[all[c]] = static_cast<Index>(c);
          tree.setZero(static_cast<Eigen::Index>(all.size()),
                       static_cast<Eigen::Index>(all.size()));
        }
        if (columns.size() == all.size()) {
          if (!add_gram(tree, y, deadline)) return false;
        } else {
          part.setZero(y.cols(), y.cols());
          if (!add_gram(part, y, deadline)) return false;
          for (std::size_t c = 0; c < columns.size(); ++c) {
            for (std::size_t r = c; r < columns.size(); ++r) {
              tree(place[columns[r]], place[columns[c]]) +=
                  part(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c));
            }
          }
        }
        if (root[f] != static_cast<Index>(f)) return true;
        for (std::size_t c = 0; c < all.size(); ++c) {
          for (std::size_t r = c; r < all.size(); ++r) {
            const double value = tree(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c));
            entries.emplace_back(all[r], all[c], value);
            if (r != c) entries.emplace_back(all[c], all[r], value);
          }
        }
        return true;
      });
  if (!whole) return std::nullopt;
  SparseColumns result(b.cols(), b.cols());
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

Vector MultifrontalCholesky::gram_diagonal(const SparseColumns& b) const {
  Vector result = Vector::Zero(b.cols());
  forward(b, Deadline(std::numeric_limits<double>::infinity()),
          [&](std::size_t, const std::vector<Index>& columns, const auto& y) {
            for (std::size_t c = 0; c < columns.size(); ++c) {
              result[columns[c]] += y.col(static_cast<Eigen::Index>(c)).squaredNorm();
            }
            return true;
          });
  return result;
}

}  // namespace fclib
