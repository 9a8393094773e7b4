#include "linalg/factorization.hpp"

#include <Eigen/LU>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseLU>
#include <algorithm>
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

/// A^T A. Each sum is computed once: column by column the part on and below the diagonal, then its
/// mirror image. Nothing if the deadline passes.
std::optional<SparseColumns> square(const SparseColumns& a, const Deadline& deadline) {
  const SparseColumns rows = a.transpose();
  const auto m = static_cast<Index>(a.cols());
  // the entries of a row of A from the present column on
  std::vector<Index> next(rows.outerIndexPtr(), rows.outerIndexPtr() + rows.cols());
  std::vector<double> sum(m, -0.0);  // adding it changes nothing, not even a signed zero
  std::vector<Index> last(m, -1);
  std::vector<Index> found;
  // if rows are dense, words take less than entries
  std::optional<Bits> bits;
  if (a.rows() * (m / 64 + 1) <= a.nonZeros()) bits.emplace(a, m);
  SparseColumns lower(m, m);
  lower.reserve(rows.nonZeros());
  for (Index col = 0; col < m; ++col) {
    if (col % columns_at_once == 0 && deadline.passed()) return std::nullopt;
    found.clear();
    for (SparseColumns::InnerIterator entry(a, col); entry; ++entry) {
      const auto k = static_cast<std::size_t>(entry.row());
      const Index first = next[k]++;
      const Index* row = rows.innerIndexPtr() + first;
      const double* value = rows.valuePtr() + first;
      const Index count = rows.outerIndexPtr()[k + 1] - first;
      if (bits) {
        bits->add(static_cast<Index>(k), col);
        if (row[count - 1] - row[0] == count - 1) {  // without gaps
          Eigen::Map<Vector>(&sum[row[0]], count) +=
              entry.value() * Eigen::Map<const Vector>(value, count);
        } else {
          for (Index at = 0; at < count; ++at) sum[row[at]] += value[at] * entry.value();
        }
        continue;
      }
      for (Index at = 0; at < count; ++at) {
        sum[row[at]] += value[at] * entry.value();
        if (last[row[at]] != col) {
          last[row[at]] = col;
          found.push_back(row[at]);
        }
      }
    }
    lower.startVec(col);
    const auto keep = [&](Index row) {
      lower.insertBack(row, col) = sum[row];
      sum[row] = -0.0;
    };
    if (bits) {
      bits->take(col, keep);
    } else {
      std::sort(found.begin(), found.end());
      std::for_each(found.begin(), found.end(), keep);
    }
  }
  lower.finalize();
  return mirrored(lower);
}

bool is_symmetric(const SparseColumns& a) {
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
  const SparseColumns& lower = cholesky_->matrixL().nestedExpression();
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
  const bool whole = lu_ || blocks_;
  const SparseColumns x = whole ? solve(b) : *half_solve(b, never);
  Vector result(b.cols());
  for (Eigen::Index col = 0; col < b.cols(); ++col) {
    result[col] = whole ? b.col(col).dot(x.col(col)) : x.col(col).squaredNorm();
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
  const SparseColumns& lower = cholesky_->matrixL().nestedExpression();
  const SparseColumns permuted = cholesky_->permutationP() * b;
  const auto n = static_cast<std::size_t>(lower.rows());

  // parent in the elimination tree: the first entry below the diagonal of each column of L
  std::vector<Index> parent(n, -1);
  for (std::size_t col = 0; col < n; ++col) {
    for (SparseColumns::InnerIterator entry(lower, static_cast<Eigen::Index>(col)); entry;
         ++entry) {
      const auto row = static_cast<Index>(entry.row());
      if (row > static_cast<Index>(col) && (parent[col] < 0 || row < parent[col]))
        parent[col] = row;
    }
  }

  // each column: its pattern is what the tree reaches from that of the right-hand side (Gilbert &
  // Peierls)
  std::vector<double> work(n, 0.0);
  std::vector<Index> visited(n, -1);
  std::vector<Index> reach;
  SparseColumns result(b.rows(), b.cols());
  result.reserve(permuted.nonZeros());
  for (Index col = 0; col < static_cast<Index>(b.cols()); ++col) {
    if (col % columns_at_once == 0 && deadline.passed()) return std::nullopt;
    reach.clear();
    for (SparseColumns::InnerIterator entry(permuted, col); entry; ++entry) {
      work[static_cast<std::size_t>(entry.row())] = entry.value();
      for (auto node = static_cast<Index>(entry.row()); node >= 0 && visited[node] != col;
           node = parent[node]) {
        visited[node] = col;
        reach.push_back(node);
      }
    }
    std::sort(reach.begin(), reach.end());
    result.startVec(col);
    for (const Index node : reach) {
      SparseColumns::InnerIterator entry(lower, node);  // the diagonal comes first
      const double value = work[node] / entry.value();
      for (++entry; entry; ++entry) work[entry.row()] -= entry.value() * value;
      result.insertBack(node, col) = value;
      work[node] = 0;
    }
  }
  result.finalize();
  return result;
}

}  // namespace fclib
