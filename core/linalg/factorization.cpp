#include "linalg/factorization.hpp"

#include <Eigen/LU>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseLU>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>

#include "error.hpp"
#include "linalg/groups.hpp"

namespace fclib {

namespace {

/// Supernodes are tried only for what may be a mesh: at least so many rows, and entries in each.
constexpr Eigen::Index large = 1000;
constexpr Eigen::Index mesh_entries = 20;
/// ... and they are used if an LU factorisation would take at least so many multiplications.
constexpr double supernodal_flops = 1e8;

/// Dense blocks are factorised if at least this share of their entries is there.
constexpr double dense_share = 0.5;

/// The clock is read after so many columns of a product.
constexpr Index columns_at_once = 64;

const Deadline never(std::numeric_limits<double>::infinity());

/// The symmetric matrix of which this is the lower triangle.
SparseColumns mirrored(const SparseColumns& lower) {
  const auto n = static_cast<Index>(lower.cols());
  SparseColumns result(n, n);
  Index* const first = result.outerIndexPtr();
  for (Index col = 0; col < n; ++col) {
    for (SparseColumns::InnerIterator entry(lower, col); entry; ++entry) {
      ++first[col + 1];
      if (entry.row() != col) ++first[entry.row() + 1];
    }
  }
  std::partial_sum(first, first + n + 1, first);
  result.resizeNonZeros(first[n]);
  // the entries above the diagonal of a column come from the columns before it
  std::vector<Index> next(first, first + n);
  const auto put = [&](Index row, Index col, double value) {
    result.innerIndexPtr()[next[col]] = row;
    result.valuePtr()[next[col]++] = value;
  };
  for (Index col = 0; col < n; ++col) {
    for (SparseColumns::InnerIterator entry(lower, col); entry; ++entry) {
      const auto row = static_cast<Index>(entry.row());
      put(row, col, entry.value());
      if (row != col) put(col, row, entry.value());
    }
  }
  return result;
}

/// A B, column by column, or nothing if the deadline passes.
std::optional<SparseColumns> product(const SparseColumns& a, const SparseColumns& b,
                                     const Deadline& deadline) {
  SparseColumns result(a.rows(), b.cols());
  for (Eigen::Index col = 0; col < b.cols(); col += columns_at_once) {
    if (deadline.passed()) return std::nullopt;
    const Eigen::Index count = std::min<Eigen::Index>(columns_at_once, b.cols() - col);
    const SparseColumns part = a * SparseColumns(b.middleCols(col, count));
    for (Eigen::Index k = 0; k < count; ++k) {
      result.startVec(col + k);
      for (SparseColumns::InnerIterator at(part, k); at; ++at) {
        result.insertBack(at.row(), col + k) = at.value();
      }
    }
  }
  result.finalize();
  return result;
}

/// The possible columns of an entry in the present column of A^T A, as bits of words.
class Bits {
 public:
  Bits(const SparseColumns& a, Index columns)
      : words_(columns / size + 1), rows_(static_cast<std::size_t>(words_ * a.rows())) {
    for (Index col = 0; col < columns; ++col) {
      for (SparseColumns::InnerIterator entry(a, col); entry; ++entry) {
        rows_[static_cast<std::size_t>(entry.row() * words_ + col / size)] |= one << (col % size);
      }
    }
    found_.resize(static_cast<std::size_t>(words_));
  }

  /// Adds the columns from this one on that have an entry in a row of A.
  void add(Index row, Index col) {
    const std::uint64_t* own = rows_.data() + static_cast<std::size_t>(row * words_);
    for (Index word = col / size; word < words_; ++word) found_[word] |= own[word];
  }

  /// Visits the columns that were added, from this one on in order, and forgets them.
  template <class Visitor>
  void take(Index col, const Visitor& visit) {
    const Index first = col / size;
    found_[first] &= ~std::uint64_t{0} << (col % size);
    for (Index word = first; word < words_; ++word) {
      for (std::uint64_t left = std::exchange(found_[word], 0); left; left &= left - 1) {
        visit(word * size + std::countr_zero(left));
      }
    }
  }

 private:
  static constexpr Index size = 64;
  static constexpr std::uint64_t one = 1;
  Index words_;
  std::vector<std::uint64_t> rows_;
  std::vector<std::uint64_t> found_;
};

/// An entry of A^T A: the sum of the products of two columns, row after row.
double product(const SparseColumns& a, Index one, Index other) {
  double sum = -0.0;  // adding to it changes nothing, not even a signed zero
  SparseColumns::InnerIterator left(a, one), right(a, other);
  while (left && right) {
    if (left.row() == right.row()) sum += left.value() * right.value();
    const bool both = left.row() == right.row(), first = left.row() < right.row();
    if (both || first) ++left;
    if (both || !first) ++right;
  }
  return sum;
}

/// The lower triangle of A^T A, by some columns at once: the sums of a row of A lie side by side.
/// `rows` is A^T.
std::optional<SparseColumns> square_of_dense_rows(const SparseColumns& a, const SparseColumns& rows,
                                                  const Deadline& deadline) {
  constexpr Index lanes = 4;
  const auto m = static_cast<Index>(a.cols());
  // the entries of a row of A from the present columns on
  std::vector<Index> next(rows.outerIndexPtr(), rows.outerIndexPtr() + rows.cols());
  std::vector<double> sum(static_cast<std::size_t>(lanes) * static_cast<std::size_t>(m), 0.0);
  Bits bits(a, m);
  SparseColumns lower(m, m);
  lower.reserve(rows.nonZeros());
  for (Index start = 0; start < m; start += lanes) {
    if (start % columns_at_once == 0 && deadline.passed()) return std::nullopt;
    const Index count = std::min(lanes, m - start);
    std::array<Index, lanes> at{};
    std::copy_n(a.outerIndexPtr() + start, count, at.begin());
    while (true) {
      auto k = static_cast<Index>(a.rows());
      for (Index lane = 0; lane < count; ++lane) {
        if (at[lane] < a.outerIndexPtr()[start + lane + 1]) {
          k = std::min(k, a.innerIndexPtr()[at[lane]]);
        }
      }
      if (k == static_cast<Index>(a.rows())) break;
      const Index first = next[k];
      std::array<double, lanes> value{};
      for (Index lane = 0; lane < count; ++lane) {
        if (at[lane] == a.outerIndexPtr()[start + lane + 1]) continue;
        if (a.innerIndexPtr()[at[lane]] != k) continue;
        value[lane] = a.valuePtr()[at[lane]++];
        ++next[k];
      }
      for (Index entry = first; entry < rows.outerIndexPtr()[k + 1]; ++entry) {
        double* const to = &sum[static_cast<std::size_t>(lanes * rows.innerIndexPtr()[entry])];
        for (Index lane = 0; lane < lanes; ++lane) {
          to[lane] += rows.valuePtr()[entry] * value[lane];
        }
      }
    }
    for (Index lane = 0; lane < count; ++lane) {
      const Index col = start + lane;
      for (SparseColumns::InnerIterator entry(a, col); entry; ++entry) {
        bits.add(static_cast<Index>(entry.row()), col);
      }
      lower.startVec(col);
      bits.take(col, [&](Index row) {
        const double found = sum[static_cast<std::size_t>(lanes * row + lane)];
        // zeros of other columns change signs of zeros, and make NaN of infinities
        const bool plain = found != 0 && std::isfinite(found);
        lower.insertBack(row, col) = plain ? found : product(a, row, col);
      });
    }
    std::fill(sum.begin() + static_cast<std::ptrdiff_t>(lanes * start), sum.end(), 0.0);
  }
  lower.finalize();
  return lower;
}

/// The same, if rows are sparse.
std::optional<SparseColumns> square_of_sparse_rows(const SparseColumns& a,
                                                   const SparseColumns& rows,
                                                   const Deadline& deadline) {
  const auto m = static_cast<Index>(a.cols());
  std::vector<Index> next(rows.outerIndexPtr(), rows.outerIndexPtr() + rows.cols());
  std::vector<double> sum(m, -0.0);
  std::vector<Index> last(m, -1);
  std::vector<Index> found;
  SparseColumns lower(m, m);
  lower.reserve(rows.nonZeros());
  for (Index col = 0; col < m; ++col) {
    if (col % columns_at_once == 0 && deadline.passed()) return std::nullopt;
    found.clear();
    for (SparseColumns::InnerIterator entry(a, col); entry; ++entry) {
      const auto k = static_cast<std::size_t>(entry.row());
      for (Index at = next[k]++; at < rows.outerIndexPtr()[k + 1]; ++at) {
        const Index row = rows.innerIndexPtr()[at];
        sum[row] += rows.valuePtr()[at] * entry.value();
        if (last[row] != col) {
          last[row] = col;
          found.push_back(row);
        }
      }
    }
    lower.startVec(col);
    std::sort(found.begin(), found.end());
    for (const Index row : found) {
      lower.insertBack(row, col) = sum[row];
      sum[row] = -0.0;
    }
  }
  lower.finalize();
  return lower;
}

/// A^T A. Each sum is computed once: the part on and below the diagonal, then its mirror image.
/// Nothing if the deadline passes.
std::optional<SparseColumns> square(const SparseColumns& a, const Deadline& deadline) {
  const SparseColumns rows = a.transpose();
  // words of bits take less than entries if rows are dense
  const bool dense = a.rows() * (a.cols() / 64 + 1) <= a.nonZeros();
  const std::optional<SparseColumns> lower =
      dense ? square_of_dense_rows(a, rows, deadline) : square_of_sparse_rows(a, rows, deadline);
  if (!lower) return std::nullopt;
  return mirrored(*lower);
}

/// Whether a matrix and its transpose have the same entries, in the same order.
bool is_its_transpose(const SparseColumns& a) {
  const Index* const first = a.outerIndexPtr();
  std::vector<Index> next(first, first + a.cols());
  for (Index col = 0; col < static_cast<Index>(a.cols()); ++col) {
    for (SparseColumns::InnerIterator entry(a, col); entry; ++entry) {
      const Index at = next[static_cast<std::size_t>(entry.row())]++;
      if (at >= first[entry.row() + 1] || a.innerIndexPtr()[at] != col ||
          a.valuePtr()[at] != entry.value()) {
        return false;
      }
    }
  }
  return true;
}

bool is_symmetric(const SparseColumns& a) {
  if (a.isCompressed() && is_its_transpose(a)) return true;
  const SparseColumns transposed = a.transpose();
  const SparseColumns difference = a - transposed;
  double largest = 0;
  double gap = 0;
  for (Eigen::Index k = 0; k < a.nonZeros(); ++k) {
    largest = std::max(largest, std::abs(a.valuePtr()[k]));
  }
  for (Eigen::Index k = 0; k < difference.nonZeros(); ++k) {
    gap = std::max(gap, std::abs(difference.valuePtr()[k]));
  }
  return gap <= 1e-15 * largest;
}

}  // namespace

struct Factorization::Cholesky
    : Eigen::SimplicialLLT<SparseColumns, Eigen::Lower, Eigen::AMDOrdering<Index>> {
  using SimplicialLLT::SimplicialLLT;

  [[nodiscard]] const SparseColumns& lower() const { return matrixL().nestedExpression(); }

  /// The rows that L^-1 P b may reach, from those of b: paths in the elimination tree (Gilbert &
  /// Peierls).
  class Reach {
   public:
    explicit Reach(const Cholesky& factors)
        : parent_(factors.m_parent),
          place_(factors.permutationP().indices()),
          visited_(static_cast<std::size_t>(parent_.size()), false) {}

    /// Adds those from a row of b, whose place in P b is returned.
    Index add(Eigen::Index row) {
      const Index place = place_[row];
      for (Index node = place; node >= 0 && !visited_[node]; node = parent_[node]) {
        visited_[node] = true;
        rows_.push_back(node);
      }
      return place;
    }

    /// Visits them in their order, and forgets them.
    template <class Visitor>
    void take(const Visitor& visit) {
      std::sort(rows_.begin(), rows_.end());
      for (const Index node : rows_) {
        visit(node);
        visited_[node] = false;
      }
      rows_.clear();
    }

   private:
    const VectorI& parent_;
    const Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, Index>::IndicesType& place_;
    std::vector<char> visited_;
    std::vector<Index> rows_;
  };
};
struct Factorization::LU : Eigen::SparseLU<SparseColumns, Eigen::COLAMDOrdering<Index>> {};

/// LU factors of a matrix that falls into dense blocks: P_k A_k = L_k U_k of the rows of block k.
class Factorization::Blocks {
 public:
  /// Finds the blocks. They are factorised only if dense().
  explicit Blocks(const SparseColumns& a) {
    Groups groups(static_cast<Index>(a.rows()));
    double entries = 0;
    for (Index col = 0; col < static_cast<Index>(a.cols()); ++col) {
      for (SparseColumns::InnerIterator entry(a, col); entry; ++entry) {
        if (entry.value() == 0) continue;
        ++entries;
        groups.link(static_cast<Index>(entry.row()), col);
      }
    }
    block_ = groups.numbers();
    for (Index row = 0; row < static_cast<Index>(block_.size()); ++row) {
      rows_.resize(std::max(rows_.size(), static_cast<std::size_t>(block_[row]) + 1));
      auto& rows = rows_[block_[row]];
      place_.push_back(static_cast<Index>(rows.size()));
      rows.push_back(row);
    }
    double size = 0;
    for (const auto& rows : rows_) size += std::pow(static_cast<double>(rows.size()), 2);
    dense_ = entries >= dense_share * size;
  }

  [[nodiscard]] bool dense() const { return dense_; }

  /// Returns false if the matrix is singular.
  [[nodiscard]] bool factorise(const SparseColumns& a) {
    for (const auto& rows : rows_) {
      Dense block = Dense::Zero(size_of(rows), size_of(rows));
      for (const Index col : rows) {
        for (SparseColumns::InnerIterator entry(a, col); entry; ++entry) {
          if (entry.value() != 0) block(place_[entry.row()], place_[col]) += entry.value();
        }
      }
      factors_.emplace_back(block);
      if ((factors_.back().matrixLU().diagonal().array() == 0).any()) return false;
    }
    return true;
  }

  [[nodiscard]] Vector solve(ConstVectorRef b) const {
    Vector x(b.size());
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      x(rows_[k]) = Vector(factors_[k].solve(Vector(b(rows_[k]))));
    }
    return x;
  }

  /// A^-1 B. A column costs what the blocks cost that it touches.
  [[nodiscard]] SparseColumns solve(const SparseColumns& b) const {
    SparseColumns result(b.rows(), b.cols());
    result.reserve(b.nonZeros());
    std::vector<std::pair<Index, double>> entries;
    std::vector<Index> touched;
    for (Index col = 0; col < static_cast<Index>(b.cols()); ++col) {
      touched.clear();
      entries.clear();
      for (SparseColumns::InnerIterator entry(b, col); entry; ++entry) {
        touched.push_back(block_[entry.row()]);
      }
      std::sort(touched.begin(), touched.end());
      touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
      for (const Index block : touched) {
        const auto& rows = rows_[block];
        Vector part = Vector::Zero(size_of(rows));
        for (SparseColumns::InnerIterator entry(b, col); entry; ++entry) {
          if (block_[entry.row()] == block) part[place_[entry.row()]] = entry.value();
        }
        part = Vector(factors_[block].solve(part));
        for (std::size_t k = 0; k < rows.size(); ++k) {
          entries.emplace_back(rows[k], part[static_cast<Eigen::Index>(k)]);
        }
      }
      std::sort(entries.begin(), entries.end());
      result.startVec(col);
      for (const auto& [row, value] : entries) result.insertBack(row, col) = value;
    }
    result.finalize();
    return result;
  }

 private:
  using Dense = Eigen::MatrixXd;

  static Eigen::Index size_of(const std::vector<Index>& rows) {
    return static_cast<Eigen::Index>(rows.size());
  }

  std::vector<std::vector<Index>> rows_;  // of each block
  std::vector<Index> block_, place_;      // of each row: its block, and where it is in it
  std::vector<Eigen::PartialPivLU<Dense>> factors_;
  bool dense_ = false;
};

Factorization::Factorization(Factorization&&) noexcept = default;
Factorization& Factorization::operator=(Factorization&&) noexcept = default;
Factorization::~Factorization() = default;

Factorization::Factorization(const SparseColumns& a, const std::string& name, bool definite) {
  if (a.rows() == 0) return;
  if (definite && is_symmetric(a)) {
    if (a.rows() >= large && a.nonZeros() >= mesh_entries * a.rows()) {
      SparseColumns both = a;  // a zero may be stored on one side only
      both += SparseColumns(a.transpose());
      both *= 0.5;
      Fronts symbolic(MultifrontalCholesky::symmetric_pattern(both));
      if (symbolic.flops > supernodal_flops) {
        supernodal_ = std::make_unique<MultifrontalCholesky>(std::move(symbolic), both);
        if (!supernodal_->positive_definite()) {
          throw Error(ErrorKind::unsuitable, name + " is not positive definite");
        }
        return;
      }
    }
    cholesky_ = std::make_unique<Cholesky>(a);
    if (cholesky_->info() != Eigen::Success) {
      throw Error(ErrorKind::unsuitable, name + " is not positive definite");
    }
    return;
  }
  blocks_ = std::make_unique<Blocks>(a);
  bool regular = true;
  if (blocks_->dense()) {
    regular = blocks_->factorise(a);
  } else {
    blocks_.reset();
    lu_ = std::make_unique<LU>();
    lu_->compute(a);
    regular = lu_->info() == Eigen::Success;
  }
  if (!regular) throw Error(ErrorKind::unsuitable, name + " is singular");
}

Vector Factorization::solve(ConstVectorRef b) const {
  if (supernodal_) return supernodal_->solve(b);
  if (cholesky_) return cholesky_->solve(b);
  if (blocks_) return blocks_->solve(b);
  if (lu_) return lu_->solve(b);
  return b;
}

Vector Factorization::terms(ConstVectorRef x) const {
  if (supernodal_) return supernodal_->terms(x);
  if (!cholesky_) return Vector::Zero(x.size());
  const SparseColumns& lower = cholesky_->lower();
  const Vector permuted = cholesky_->permutationP() * x;
  Vector sizes = Vector::Zero(x.size());
  for (Eigen::Index col = 0; col < lower.cols(); ++col) {
    double sum = 0;
    for (SparseColumns::InnerIterator entry(lower, col); entry; ++entry) {
      sum += entry.value() * permuted[entry.row()];
    }
    for (SparseColumns::InnerIterator entry(lower, col); entry; ++entry) {
      sizes[entry.row()] += std::abs(entry.value() * sum);
    }
  }
  return cholesky_->permutationPinv() * sizes;
}

SparseColumns Factorization::solve(const SparseColumns& b) const {
  if (supernodal_) {
    SparseColumns result(b.rows(), b.cols());
    for (Eigen::Index col = 0; col < b.cols(); ++col) {
      result.col(col) = supernodal_->solve(Vector(b.col(col))).sparseView();
    }
    return result;
  }
  if (cholesky_) return cholesky_->solve(b);
  if (blocks_) return blocks_->solve(b);
  if (lu_) return lu_->solve(b);
  return b;
}

SparseColumns Factorization::gram(const SparseColumns& b) const { return *gram(b, never); }

std::optional<SparseColumns> Factorization::gram(const SparseColumns& b,
                                                 const Deadline& deadline) const {
  if (supernodal_) return supernodal_->gram(b, deadline);
  if (lu_ || blocks_) return product(SparseColumns(b.transpose()), solve(b), deadline);
  const std::optional<SparseColumns> half = half_solve(b, deadline);
  if (!half) return std::nullopt;
  return square(*half, deadline);
}

Vector Factorization::gram_diagonal(const SparseColumns& b) const {
  if (supernodal_) return supernodal_->gram_diagonal(b);
  Vector result(b.cols());
  if (!cholesky_) {
    const SparseColumns x = solve(b);
    for (Eigen::Index col = 0; col < b.cols(); ++col) result[col] = b.col(col).dot(x.col(col));
    return result;
  }
  // some columns at once, as those of a contact reach the same rows: their L^-1 P b, row by row
  constexpr Eigen::Index lanes = 4;
  const SparseColumns& lower = cholesky_->lower();
  Cholesky::Reach reach(*cholesky_);
  std::vector<double> work(static_cast<std::size_t>(lanes * lower.rows()), 0.0);
  for (Eigen::Index first = 0; first < b.cols(); first += lanes) {
    const Eigen::Index count = std::min(lanes, b.cols() - first);
    for (Eigen::Index lane = 0; lane < count; ++lane) {
      for (SparseColumns::InnerIterator entry(b, first + lane); entry; ++entry) {
        work[static_cast<std::size_t>(lanes * reach.add(entry.row()) + lane)] = entry.value();
      }
    }
    std::array<double, lanes> sum{};
    reach.take([&](Index node) {
      const Index own = lower.outerIndexPtr()[node];  // the diagonal comes first
      const Index past = lower.outerIndexPtr()[node + 1];
      double* const at = &work[static_cast<std::size_t>(lanes * node)];
      std::array<double, lanes> value;
      for (Eigen::Index lane = 0; lane < lanes; ++lane) {
        value[lane] = at[lane] / lower.valuePtr()[own];
        sum[lane] += value[lane] * value[lane];
        at[lane] = 0;
      }
      for (Index k = own + 1; k < past; ++k) {
        double* const below = &work[static_cast<std::size_t>(lanes * lower.innerIndexPtr()[k])];
        for (Eigen::Index lane = 0; lane < lanes; ++lane) {
          below[lane] -= lower.valuePtr()[k] * value[lane];
        }
      }
    });
    for (Eigen::Index lane = 0; lane < count; ++lane) result[first + lane] = sum[lane];
  }
  return result;
}

std::optional<SparseColumns> Factorization::half(const SparseColumns& b) const {
  if (!cholesky_) return std::nullopt;
  return half_solve(b, never);
}

std::optional<SparseColumns> Factorization::half_solve(const SparseColumns& b,
                                                       const Deadline& deadline) const {
  if (!cholesky_) return b;
  const SparseColumns& lower = cholesky_->lower();
  Cholesky::Reach reach(*cholesky_);
  std::vector<double> work(static_cast<std::size_t>(lower.rows()), 0.0);
  SparseColumns result(b.rows(), b.cols());
  result.reserve(b.nonZeros());
  for (Index col = 0; col < static_cast<Index>(b.cols()); ++col) {
    if (col % columns_at_once == 0 && deadline.passed()) return std::nullopt;
    for (SparseColumns::InnerIterator entry(b, col); entry; ++entry) {
      work[static_cast<std::size_t>(reach.add(entry.row()))] = entry.value();
    }
    result.startVec(col);
    reach.take([&](Index node) {
      SparseColumns::InnerIterator entry(lower, node);  // the diagonal comes first
      const double value = work[node] / entry.value();
      for (++entry; entry; ++entry) work[entry.row()] -= entry.value() * value;
      result.insertBack(node, col) = value;
      work[node] = 0;
    });
  }
  result.finalize();
  return result;
}

}  // namespace fclib
