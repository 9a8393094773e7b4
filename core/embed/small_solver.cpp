#include "embed/small_solver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "contact/alart_curnier.hpp"
#include "contact/natural_squares.hpp"
#include "embed/contact_judge.hpp"
#include "embed/memory.hpp"
#include "embed/rounding.hpp"
#include "embed/sweep_rule.hpp"
#include "linalg/extended.hpp"
#include "merit/natural_sums.hpp"

namespace fclib {

namespace {

constexpr int most_sweeps = SweepRule::most;
constexpr int newton_attempts = 8;
constexpr int newton_steps = 12;  // of the first attempt; later ones have more
/// The rate of sweeps is trusted for so many sweeps ahead.
constexpr double most_foreseen = 80;
/// Sweeps before the first attempt of Newton's method. They find most of the statuses.
constexpr int first_sweeps = 3;
/// The proximal weight over the mean diagonal of W. With a heavier weight, steps are shorter and
/// safer. With many contacts the next statuses are not near, so the light weight is for few.
constexpr double light = 1e-9;
constexpr double heavy = 1e-3;
constexpr std::size_t few_contacts = 12;
/// The largest problem that double precision judges. A row of W r + q has so many terms that its
/// rounding is less than what the merit allows to a velocity (merit/equations).
constexpr Index most_bounded = 32;
/// A sweep solves each contact to this part of what the last sweep has changed, and of what the
/// tolerance leaves to all.
constexpr double closeness_to_change = 0.1;
constexpr double closeness = 0.01;
/// Unknowns of the largest system that is factorised here. It is dense.
constexpr std::size_t most_unknowns = 900;

/// Solves A x = b by elimination with column pivots. A (n x n) is by rows, and b stands behind each
/// row; x replaces b. Returns false if A is singular.
bool eliminate(double* rows, Index n) {
  const Index width = n + 1;
  const auto row = [&](Index k) { return rows + static_cast<std::ptrdiff_t>(width) * k; };
  for (Index k = 0; k < n; ++k) {
    Index pivot = k;
    double largest = std::abs(row(k)[k]);
    for (Index i = k + 1; i < n; ++i) {
      const double size = std::abs(row(i)[k]);
      if (size > largest) {
        largest = size;
        pivot = i;
      }
    }
    if (!(largest > 0) || !std::isfinite(largest)) return false;
    if (pivot != k) std::swap_ranges(row(k) + k, row(k) + width, row(pivot) + k);
    const double* __restrict from = row(k);
    const double inverse = 1 / from[k];
    for (Index i = k + 1; i < n; ++i) {
      double* __restrict to = row(i);
      if (to[k] == 0) continue;
      const double factor = to[k] * inverse;
      for (Index j = k + 1; j < width; ++j) to[j] -= factor * from[j];
    }
  }
  for (Index k = n; k-- > 0;) {
    double* at = row(k);
    double x = at[n];
    for (Index j = k + 1; j < n; ++j) x -= at[j] * row(j)[n];
    at[n] = x / at[k];
  }
  return true;
}

constexpr const char* not_finite = "has an entry that is not finite";

bool all_finite(const double* x, std::int64_t size) {
  double sum = 0;  // zero, or NaN: without a branch
  for (std::int64_t k = 0; k < size; ++k) sum += x[k] * 0.0;
  return sum == 0;
}

/// r of a contact moved against its velocity u, and put on the disk of its normal part.
template <int D>
inline void projected_step(double normal, double tangent, double mu, const double* u, double* r) {
  r[0] = std::max(0.0, r[0] - normal * u[0]);
  double square = 0;
  for (int i = 1; i < D; ++i) {
    r[i] -= tangent * u[i];
    square += r[i] * r[i];
  }
  const double radius = mu * r[0];
  const double scale = square > radius * radius ? radius / std::sqrt(square) : 1.0;
  for (int i = 1; i < D; ++i) r[i] *= scale;
}

/// Whether the error is above `aim` already, whatever is still to be added. ||q|| is `scale`, and
/// ||rho q|| is `scaled_scale`.
bool is_beyond(const NaturalSquares<double>& squares, double aim, double scale,
               double scaled_scale) {
  const double most = aim * scale;
  const double scaled_most = aim * scaled_scale;
  return squares.plain > most * most || squares.velocities > most * most ||
         squares.impulses > scaled_most * scaled_most;
}

/// The merit's error in double precision, and what rounding may have done to it. The natural map
/// changes by no more than u^, and that by at most 1 + mu times u.
template <int D>
class BoundedError {
 public:
  using Vec = ContactVector<D>;

  /// `mean` is at least the mean ||q^a||, for the slip that is rounding.
  BoundedError(Index nc, double mean) : unit_(unit_of_rounding<D>(nc)), mean_(mean) {}

  /// A contact with the velocity u, whose terms have the sizes `terms`.
  void add(double mu, const Vec& u, const Vec& terms, const Vec& r, double rho) {
    const Coulomb<D> cone(mu);
    squares_.add_plain(cone, u, r);
    squares_.add_scaled(cone, u, r, rho);
    const double size = r.norm();
    const double speed = terms.norm() + mean_;
    const double factor = unit_ * (1 + mu);
    plain_ += factor * (speed + size);
    velocities_ += factor * (speed + size / rho);
    impulses_ += factor * (rho * speed + size);
  }

  [[nodiscard]] const NaturalSquares<double>& squares() const { return squares_; }

  /// The error if ||q|| is `scale` and ||rho q|| is `scaled_scale`.
  [[nodiscard]] double error(double scale, double scaled_scale) const {
    return squares_.error(scale, scaled_scale);
  }
  /// A bound on it; infinity if that would be too far from the error.
  [[nodiscard]] double bound(double error, double tolerance, double scale,
                             double scaled_scale) const {
    const double rounding =
        unit_ * error + larger_error(plain_ / scale, velocities_ / scale, impulses_ / scaled_scale);
    if (!(rounding <= bounded_excess * tolerance)) return std::numeric_limits<double>::infinity();
    return error + rounding;
  }

 private:
  double unit_, mean_;
  NaturalSquares<double> squares_;
  double plain_ = 0, velocities_ = 0, impulses_ = 0;
};

}  // namespace

template <int D>
void SmallSolver<D>::resize(Index nc) {
  nc_ = nc;
  const auto count = static_cast<std::size_t>(nc);
  grow(diagonal_, count);
  grow(row_, count + 1);
  grow(rho_, count);
  grow(steps_, count);
  grow(place_, count);
  grow(members_, count);
  grow(root_, count);
  grow(first_, count + 1);
  for (auto* vector : {&best_, &u_}) grow(*vector, D * count);
}

template <int D>
const char* SmallSolver<D>::take(Index nc, const double* W, const double* q, const double* mu) {
  resize(nc);
  known_ = Pattern::none;
  const auto count = static_cast<std::size_t>(nc);
  grow(blocks_, count * count);
  grow(column_, count * count);
  std::size_t at = 0;
  const auto m = static_cast<std::ptrdiff_t>(D) * nc;
  Mat sums = Mat::Zero();  // zeros, or NaN; entries apart, so that none waits for another
  for (Index a = 0; a < nc; ++a) {
    row_[static_cast<std::size_t>(a)] = at;
    for (Index b = 0; b < nc; ++b) {
      const double* from = W + D * a * m + D * b;
      Mat& to = a == b ? diagonal_[static_cast<std::size_t>(a)] : blocks_[at];
      bool empty = true;
      for (int i = 0; i < D; ++i) {
        for (int j = 0; j < D; ++j) {
          const double value = from[i * m + j];
          to(i, j) = value;
          sums(i, j) += value * 0.0;
          empty &= value == 0;
        }
      }
      if (a == b || empty) continue;
      column_[at++] = b;
    }
  }
  if (!(sums.array() == 0).all()) return not_finite;
  row_[count] = at;
  find_islands();
  prepare(q, mu);
  return nullptr;
}

/// Whether W has the pattern of the last one.
template <int D>
bool SmallSolver<D>::knows(Pattern kind, Index nc, std::span<const Index> p,
                           std::span<const Index> i) const {
  return known_ == kind && nc_ == nc && known_p_size_ == p.size() && known_i_size_ == i.size() &&
         std::equal(p.begin(), p.end(), known_p_.begin()) &&
         std::equal(i.begin(), i.end(), known_i_.begin());
}

template <int D>
void SmallSolver<D>::know(Pattern kind, std::span<const Index> p, std::span<const Index> i) {
  known_ = kind;
  known_p_size_ = p.size();
  known_i_size_ = i.size();
  grow(known_p_, p.size());
  grow(known_i_, i.size());
  std::copy(p.begin(), p.end(), known_p_.begin());
  std::copy(i.begin(), i.end(), known_i_.begin());
}

template <int D>
const char* SmallSolver<D>::take(const MatrixView& W, const double* q, const double* mu) {
  const Index nc = W.rows / D;
  if (W.storage == Storage::dense) return take_dense_by_columns(W, q, mu);
  const Pattern kind = W.storage == Storage::triplet ? Pattern::triplet
                       : W.storage == Storage::csc   ? Pattern::csc
                                                     : Pattern::csr;
  const auto nnz = static_cast<std::size_t>(W.nnz);
  const std::size_t pointers = W.storage == Storage::triplet ? nnz
                               : W.p == nullptr              ? 0
                                                             : static_cast<std::size_t>(W.rows) + 1;
  const std::span<const Index> p(W.p, pointers);
  const std::span<const Index> i(W.i, nnz);
  if (!knows(kind, nc, p, i)) {
    known_ = Pattern::none;
    resize(nc);
    if (const char* wrong = learn(W)) return wrong;
    find_islands();
    know(kind, p, i);
  } else if (!all_finite(W.x, W.nnz)) {
    return "has an entry that is not finite, or an index out of range";
  }
  for (Index a = 0; a < nc; ++a) diagonal_[static_cast<std::size_t>(a)].setZero();
  for (std::size_t k = 0; k < row_[static_cast<std::size_t>(nc)]; ++k) blocks_[k].setZero();
  for (std::size_t k = 0; k < nnz; ++k) {
    const std::ptrdiff_t place = where_[k];
    double* to =
        place < 0 ? diagonal_.front().data() + (-1 - place) : blocks_.front().data() + place;
    *to += W.x[k];
  }
  prepare(q, mu);
  return nullptr;
}

template <int D>
const char* SmallSolver<D>::take_dense_by_columns(const MatrixView& W, const double* q,
                                                  const double* mu) {
  const auto m = static_cast<std::size_t>(W.rows);
  grow(by_rows_, m * m);
  for (std::size_t row = 0; row < m; ++row) {
    for (std::size_t col = 0; col < m; ++col) by_rows_[m * row + col] = W.x[m * col + row];
  }
  return take(W.rows / D, by_rows_.data(), q, mu);
}

/// Finds the blocks of a sparse W, and the place of each of its entries in them.
template <int D>
const char* SmallSolver<D>::learn(const MatrixView& W) {
  const auto count = static_cast<std::size_t>(nc_);
  // the entries of each contact's rows
  grow(entry_row_, count + 2);
  std::fill(entry_row_.begin(), entry_row_.end(), 0);
  const char* wrong = W.visit(
      [&](Index row, Index, double) { ++entry_row_[static_cast<std::size_t>(row / D) + 2]; });
  if (wrong != nullptr) return wrong;
  for (std::size_t a = 2; a < count + 2; ++a) entry_row_[a] += entry_row_[a - 1];
  grow(entries_, entry_row_[count + 1]);
  grow(where_, entry_row_[count + 1]);
  std::size_t number = 0;
  W.visit([&](Index row, Index col, double) {
    entries_[entry_row_[static_cast<std::size_t>(row / D) + 1]++] = {col, row % D, number++};
  });
  // blocks of them
  grow(block_of_, count);
  std::fill(block_of_.begin(), block_of_.end(), -1);
  std::size_t at = 0;
  for (Index a = 0; a < nc_; ++a) {
    const auto self = static_cast<std::size_t>(a);
    row_[self] = at;
    const auto first = static_cast<std::ptrdiff_t>(at);
    for (std::size_t k = entry_row_[self]; k < entry_row_[self + 1]; ++k) {
      const auto [col, component, entry] = entries_[k];
      const std::ptrdiff_t inside = (col % D) * D + component;  // blocks are by columns
      const Index b = col / D;
      if (b == a) {
        where_[entry] = -1 - (D * D * static_cast<std::ptrdiff_t>(a) + inside);
        continue;
      }
      std::ptrdiff_t& place = block_of_[static_cast<std::size_t>(b)];
      if (place < first) {
        place = static_cast<std::ptrdiff_t>(at);
        grow(blocks_, at + 1);
        grow(column_, at + 1);
        column_[at++] = b;
      }
      where_[entry] = D * D * place + inside;
    }
  }
  row_[count] = at;
  return nullptr;
}

template <int D>
const char* SmallSolver<D>::take(Index nc, const BlockView& W, const double* q, const double* mu) {
  const auto count = static_cast<std::size_t>(nc);
  if (W.starts[0] != 0) return "has blocks whose starts do not begin with 0";
  for (std::size_t a = 0; a < count; ++a) {
    if (W.starts[a + 1] < W.starts[a]) return "has blocks whose starts are not in order";
  }
  const auto number = static_cast<std::size_t>(W.starts[count]);
  const std::span<const Index> p(W.starts, count + 1);
  const std::span<const Index> i(W.columns, number);
  if (!knows(Pattern::blocks, nc, p, i)) {
    for (const Index b : i) {
      if (b < 0 || b >= nc) return "has a block whose column is out of range";
    }
    known_ = Pattern::none;
    resize(nc);
    grow(where_, number);
    grow(block_of_, count);
    grow(blocks_, number);
    grow(column_, number);
    std::fill(block_of_.begin(), block_of_.end(), -1);
    std::size_t at = 0;
    for (Index a = 0; a < nc; ++a) {
      const auto self = static_cast<std::size_t>(a);
      row_[self] = at;
      const auto first = static_cast<std::ptrdiff_t>(at);
      for (auto k = static_cast<std::size_t>(W.starts[a]);
           k < static_cast<std::size_t>(W.starts[a + 1]); ++k) {
        const Index b = W.columns[k];
        if (b == a) {
          where_[k] = -1 - static_cast<std::ptrdiff_t>(a);
          continue;
        }
        std::ptrdiff_t& place = block_of_[static_cast<std::size_t>(b)];
        if (place < first) {
          place = static_cast<std::ptrdiff_t>(at);
          column_[at++] = b;
        }
        where_[k] = place;
      }
    }
    row_[count] = at;
    find_islands();
    know(Pattern::blocks, p, i);
  }
  if (!all_finite(W.values, D * D * static_cast<std::int64_t>(number))) return not_finite;
  for (std::size_t a = 0; a < count; ++a) diagonal_[a].setZero();
  for (std::size_t k = 0; k < row_[count]; ++k) blocks_[k].setZero();
  for (std::size_t k = 0; k < number; ++k) {
    const std::ptrdiff_t place = where_[k];
    Mat& to = place < 0 ? diagonal_[static_cast<std::size_t>(-1 - place)]
                        : blocks_[static_cast<std::size_t>(place)];
    to += Eigen::Map<const Eigen::Matrix<double, D, D, Eigen::RowMajor>>(W.values + D * D * k);
  }
  prepare(q, mu);
  return nullptr;
}

/// Contacts that blocks connect, directly or by others.
template <int D>
void SmallSolver<D>::find_islands() {
  const auto count = static_cast<std::size_t>(nc_);
  for (Index a = 0; a < nc_; ++a) root_[static_cast<std::size_t>(a)] = a;
  const auto root = [&](Index a) {
    while (root_[static_cast<std::size_t>(a)] != a) {
      Index& up = root_[static_cast<std::size_t>(a)];
      up = root_[static_cast<std::size_t>(up)];
      a = up;
    }
    return a;
  };
  Index trees = nc_;
  for (Index a = 0; a < nc_ && trees > 1; ++a) {
    const auto self = static_cast<std::size_t>(a);
    for (std::size_t k = row_[self]; k < row_[self + 1]; ++k) {
      const Index one = root(a);
      const Index other = root(column_[k]);
      if (one == other) continue;
      root_[static_cast<std::size_t>(std::max(one, other))] = std::min(one, other);
      --trees;
    }
  }
  // the root of an island is its first contact
  islands_ = static_cast<std::size_t>(trees);
  largest_ = nc_;
  first_[0] = 0;
  first_[islands_] = nc_;
  if (islands_ <= 1) {
    for (Index a = 0; a < nc_; ++a) members_[static_cast<std::size_t>(a)] = a;
    return;
  }
  Index number = 0;
  for (Index a = 0; a < nc_; ++a) {
    const auto self = static_cast<std::size_t>(a);
    const Index up = root(a);
    place_[self] = up == a ? number++ : place_[static_cast<std::size_t>(up)];
  }
  std::fill_n(first_.begin(), islands_ + 1, 0);
  for (std::size_t a = 0; a < count; ++a) ++first_[static_cast<std::size_t>(place_[a]) + 1];
  largest_ = *std::max_element(first_.begin() + 1,
                               first_.begin() + static_cast<std::ptrdiff_t>(islands_) + 1);
  for (std::size_t k = 0; k < islands_; ++k) first_[k + 1] += first_[k];
  for (std::size_t a = count; a-- > 0;) {
    members_[static_cast<std::size_t>(--first_[static_cast<std::size_t>(place_[a]) + 1])] =
        static_cast<Index>(a);
  }
  // the ends have become the beginnings
  for (std::size_t k = 0; k < islands_; ++k) first_[k] = first_[k + 1];
  first_[islands_] = nc_;
}

/// The contacts alone, and the scales of the errors.
template <int D>
void SmallSolver<D>::prepare(const double* q, const double* mu) {
  q_ = q;
  mu_ = mu;
  iterations_ = 0;
  swept_ = -1;
  in_u_ = false;
  contacts_.clear();
  double squares = 0;
  double scaled = 0;
  const auto size_of = [&](Index a) {
    return diagonal_[static_cast<std::size_t>(a)].diagonal().cwiseAbs().mean();
  };
  ContactScales<double> scales;
  for (Index a = 0; a < nc_; ++a) scales.add(size_of(a));
  for (Index a = 0; a < nc_; ++a) {
    const auto self = static_cast<std::size_t>(a);
    rho_[self] = scales.rho(size_of(a));
    const double square = part(q_, a).squaredNorm();
    squares += square;
    scaled += rho_[self] * rho_[self] * square;
  }
  whole_scale_ = squares > 0 ? std::sqrt(squares) : 1;
  whole_scaled_scale_ = scaled > 0 ? std::sqrt(scaled) : 1;
  // squares of q may be lost
  squares_hold_ = has_square(whole_scale_) && has_square(whole_scaled_scale_) &&
                  (squares > 0 || std::all_of(q, q + D * static_cast<std::ptrdiff_t>(nc_),
                                              [](double x) { return x == 0; }));
  for (Index a = 0; a < nc_ && squares_hold_; ++a) {
    squares_hold_ = has_square(rho_[static_cast<std::size_t>(a)]);
  }
}

template <int D>
double SmallSolver<D>::judge(const double* r, double* u) const {
  using std::abs;  // or that of Real
  using RealVec = ContactVector<D, Real>;
  const auto size = [&](std::int64_t a) {
    Real sum = 0;
    for (int k = 0; k < D; ++k) sum += abs(Real(diagonal_[static_cast<std::size_t>(a)](k, k))) / D;
    return sum;
  };
  const auto free = [&](std::int64_t a) {
    RealVec q;
    for (int k = 0; k < D; ++k) q[k] = q_[D * a + k];
    return q;
  };
  const auto velocity = [&](std::int64_t a) {
    const auto self = static_cast<std::size_t>(a);
    RealVec result;
    result.fill(Real(0));
    const auto add = [&](const Mat& block, Index b) {
      for (int j = 0; j < D; ++j) {
        for (int i = 0; i < D; ++i) result[i] += full_product(block(i, j), r[D * b + j]);
      }
    };
    // the merit sums in the order of the columns
    std::size_t k = row_[self];
    for (; k < row_[self + 1] && column_[k] < a; ++k) add(blocks_[k], column_[k]);
    add(diagonal_[self], static_cast<Index>(a));
    for (; k < row_[self + 1]; ++k) add(blocks_[k], column_[k]);
    for (int i = 0; i < D; ++i) {
      result[i] += Real(q_[D * a + i]);
      if (u != nullptr) u[D * a + i] = static_cast<double>(result[i]);
    }
    return result;
  };
  return contact_error<D>(nc_, mu_, r, size, velocity, free);
}

template <int D>
Matrix SmallSolver<D>::matrix() const {
  Matrix result;
  result.storage = Storage::triplet;
  result.rows = result.cols = D * nc_;
  const auto add = [&](const Mat& block, Index a, Index b) {
    for (int i = 0; i < D; ++i) {
      for (int j = 0; j < D; ++j) {
        result.i.push_back(D * a + i);
        result.p.push_back(D * b + j);
        result.x.push_back(block(i, j));
      }
    }
  };
  for (Index a = 0; a < nc_; ++a) {
    const auto self = static_cast<std::size_t>(a);
    std::size_t k = row_[self];
    // by columns: what is summed in this order has the digits of a dense W
    for (; k < row_[self + 1] && column_[k] < a; ++k) add(blocks_[k], a, column_[k]);
    add(diagonal_[self], a, a);
    for (; k < row_[self + 1]; ++k) add(blocks_[k], a, column_[k]);
  }
  return result;
}

template <int D>
bool SmallSolver<D>::can_bound() const {
  return D * nc_ <= most_bounded && squares_hold_;
}

/// Whether the error of r in double precision is at most `aim`; then u is in u_. If a bound on what
/// rounding may have done to the error meets the tolerance, it is in bound_; else that is infinity.
template <int D>
bool SmallSolver<D>::bound_error(double aim, const double* r) {
  bound_ = std::numeric_limits<double>::infinity();
  BoundedError<D> found(nc_, whole_scale_);
  for (Index a = 0; a < nc_; ++a) {
    const auto self = static_cast<std::size_t>(a);
    Vec u = part(q_, a);
    Vec terms = u.cwiseAbs();
    const auto add = [&](const Mat& block, Index b) {
      for (int j = 0; j < D; ++j) {
        for (int i = 0; i < D; ++i) {
          const double product = block(i, j) * r[D * b + j];
          u[i] += product;
          terms[i] += std::abs(product);
        }
      }
    };
    add(diagonal_[self], a);
    for (std::size_t k = row_[self]; k < row_[self + 1]; ++k) add(blocks_[k], column_[k]);
    part(u_.data(), a) = u;
    found.add(mu_[a], u, terms, part(r, a), rho_[self]);
    if (is_beyond(found.squares(), aim, whole_scale_, whole_scaled_scale_)) return false;
  }
  const double error = found.error(whole_scale_, whole_scaled_scale_);
  if (!(error <= aim)) return false;
  bound_ = found.bound(error, tolerance_, whole_scale_, whole_scaled_scale_);
  if (!(bound_ <= tolerance_)) bound_ = std::numeric_limits<double>::infinity();
  return true;
}

/// Whether the error of the island meets the tolerance; with a bound on it if the island is all.
template <int D>
bool SmallSolver<D>::meets(double tolerance, const double* r) {
  if (bounds_ && islands_ == 1) return bound_error(tolerance, r);
  NaturalSquares<double> squares;
  for (const Index a : now_) {
    add_to(squares, a, r);
    if (is_beyond(squares, tolerance, scale_, scaled_scale_)) return false;
  }
  return squares.error(scale_, scaled_scale_) <= tolerance;
}

/// (W r + q)_a without W_aa r_a. By components: r was just stored so, and loads of vectors stall.
template <int D>
typename SmallSolver<D>::Vec SmallSolver<D>::coupled(Index a, const double* r) const {
  double sums[D];
  for (int i = 0; i < D; ++i) sums[i] = q_[D * a + i];
  const auto self = static_cast<std::size_t>(a);
  for (std::size_t k = row_[self]; k < row_[self + 1]; ++k) {
    const double* const block = blocks_[k].data();
    const double* const other = r + D * column_[k];
    for (int j = 0; j < D; ++j) {
      for (int i = 0; i < D; ++i) sums[i] += block[D * j + i] * other[j];
    }
  }
  Vec u;
  for (int i = 0; i < D; ++i) u[i] = sums[i];
  return u;
}

template <int D>
typename SmallSolver<D>::Vec SmallSolver<D>::velocity(Index a, const double* r) const {
  return coupled(a, r) + diagonal_[static_cast<std::size_t>(a)] * part(r, a);
}

/// Makes a sweep. Returns about the error before it: the change of r, in both units.
template <int D>
double SmallSolver<D>::sweep(double* r) {
  double natural = 0;
  double scaled = 0;
  for (const Index a : now_) {
    const auto self = static_cast<std::size_t>(a);
    double* const own = r + D * a;
    Vec next;
    for (int i = 0; i < D; ++i) next[i] = own[i];
    const Vec others = coupled(a, r);
    // a root that is only near may have a negative normal part
    if (!contacts_[self].solve(others, next, close_ * rho_[self]) &&
        !contacts_[self].solve(others, next)) {
      solvable_ = false;
      return 0;
    }
    double change = 0;
    for (int i = 0; i < D; ++i) {
      const double by = next[i] - own[i];
      change += by * by;
      own[i] = next[i];
    }
    natural += change / (rho_[self] * rho_[self]);
    scaled += change;
  }
  ++iterations_;
  return std::max(std::sqrt(natural) / scale_, std::sqrt(scaled) / scaled_scale_);
}

/// A sweep of steps by the diagonal of W, each projected on the disk of its contact. Returns the
/// change, as sweep() does.
template <int D>
double SmallSolver<D>::projected_sweep(double* r) {
  double natural = 0;
  double scaled = 0;
  for (const Index a : now_) {
    const auto self = static_cast<std::size_t>(a);
    const Mat& block = diagonal_[self];
    const Step& step = steps_[self];
    double* const own = r + D * a;
    const Vec others = coupled(a, r);
    double u[D];
    double next[D];
    for (int i = 0; i < D; ++i) {
      next[i] = own[i];
      u[i] = others[i];
      for (int j = 0; j < D; ++j) u[i] += block(i, j) * own[j];
    }
    projected_step<D>(step.normal, step.tangent, mu_[a], u, next);
    double change = 0;
    for (int i = 0; i < D; ++i) {
      const double by = next[i] - own[i];
      change += by * by;
      own[i] = next[i];
    }
    natural += change * step.square;
    scaled += change;
  }
  ++iterations_;
  return std::max(std::sqrt(natural) / scale_, std::sqrt(scaled) / scaled_scale_);
}

/// Projected sweeps as long as few of them are foreseen. Returns whether r meets the tolerance;
/// `change` is that of the last one.
template <int D>
bool SmallSolver<D>::project(double tolerance, double* r, double& change) {
  for (const Index a : now_) {
    const auto self = static_cast<std::size_t>(a);
    const Mat& block = diagonal_[self];
    double most = 0;
    for (int i = 1; i < D; ++i) most = std::max(most, block(i, i));
    if (!(block(0, 0) > 0) || !(most > 0)) return false;
    steps_[self] = {1 / block(0, 0), 1 / most, 1 / (rho_[self] * rho_[self])};
  }
  const SweepRule rule(costs());
  double last = 0;
  for (int k = 1; k <= most_sweeps; ++k) {
    change = projected_sweep(r);
    if (SweepRule::is_near(k, change, tolerance) && meets(tolerance, r)) return true;
    if (!rule.goes_on(k, last, change, tolerance) || stopped()) return false;
    last = change;
  }
  return false;
}

template <int D>
void SmallSolver<D>::add_to(NaturalSquares<double>& squares, Index a, const double* r) const {
  const Coulomb<D> cone(mu_[a]);
  const Vec u = velocity(a, r);
  const Vec ra = part(r, a);
  squares.add_plain(cone, u, ra);
  squares.add_scaled(cone, u, ra, rho_[static_cast<std::size_t>(a)]);
}

template <int D>
double SmallSolver<D>::error(const double* r) const {
  NaturalSquares<double> squares;
  for (const Index a : now_) add_to(squares, a, r);
  return squares.error(scale_, scaled_scale_);
}

/// Keeps r if it is the best so far. Returns whether it is.
template <int D>
bool SmallSolver<D>::keep(double error, const double* r, double& best) {
  if (!(error < best)) return false;
  best = error;
  for (const Index a : now_) part(best_.data(), a) = part(r, a);
  return true;
}

template <int D>
void SmallSolver<D>::restore(double* r) const {
  for (const Index a : now_) part(r, a) = part(best_.data(), a);
}

/// One step of Newton's method from r. Returns false if its system is singular.
template <int D>
bool SmallSolver<D>::newton_step(double weight_of_mean, double* r) {
  Index count = 0;
  // open contacts are left out
  for (const Index a : now_) {
    const Vec u = velocity(a, r);
    const double rho = rho_[static_cast<std::size_t>(a)];
    const bool open = !(r[D * a] - rho * u[0] > 0);
    place_[static_cast<std::size_t>(a)] = open ? -1 : count++;
  }
  for (const Index a : now_) {
    if (place_[static_cast<std::size_t>(a)] < 0) part(r, a).setZero();
  }
  const Index n = D * count;
  const auto width = static_cast<std::size_t>(n) + 1;
  grow(system_, static_cast<std::size_t>(n) * width);
  std::fill_n(system_.begin(), static_cast<std::size_t>(n) * width, 0.0);
  double trace = 0;
  for (const Index a : now_) trace += 1 / rho_[static_cast<std::size_t>(a)];
  const double weight = weight_of_mean * trace / static_cast<double>(now_.size());
  for (const Index a : now_) {
    const auto self = static_cast<std::size_t>(a);
    const Index at = place_[self];
    if (at < 0) continue;
    const double rho = rho_[self];
    const Coulomb<D> cone(mu_[a]);
    const Vec z = part(r, a) - rho * velocity(a, r);
    const Mat slope = alart_curnier_jacobian(cone, z);
    const Mat scaled = rho * slope;
    using Rows = Eigen::Map<Eigen::Matrix<double, D, Eigen::Dynamic, Eigen::RowMajor>, 0,
                            Eigen::OuterStride<>>;
    Rows rows(system_.data() + static_cast<std::size_t>(D * at) * width, D, n + 1,
              Eigen::OuterStride<>(n + 1));
    Mat block = diagonal_[self];
    for (int k = 0; k < D; ++k) block(k, k) += weight;
    const Mat own = Mat::Identity() - slope + scaled * block;
    rows.template middleCols<D>(D * at) = own;
    for (std::size_t k = row_[self]; k < row_[self + 1]; ++k) {
      const Index other = place_[static_cast<std::size_t>(column_[k])];
      if (other < 0) continue;
      const Mat product = scaled * blocks_[k];
      rows.template middleCols<D>(D * other) = product;
    }
    const Vec left = alart_curnier_projection(cone, z) - part(r, a);
    rows.col(n) = left;
  }
  if (!eliminate(system_.data(), n)) return false;
  for (const Index a : now_) {
    const Index at = place_[static_cast<std::size_t>(a)];
    if (at < 0) continue;
    for (int k = 0; k < D; ++k) {
      r[D * a + k] +=
          system_[static_cast<std::size_t>(D * at + k) * width + static_cast<std::size_t>(n)];
    }
  }
  return true;
}

/// Makes steps from r as long as they improve it. Returns whether r meets the tolerance.
template <int D>
bool SmallSolver<D>::newton(int attempt, double tolerance, double* r, double& best) {
  double weight =
      now_.size() <= few_contacts && attempt == 0 ? light : heavy * std::pow(10, attempt / 2);
  int worse = 0;
  close_ = 0;
  for (int k = 0; k < (1 + attempt) * newton_steps && worse < 3 + 2 * attempt; ++k) {
    if (stopped() || !newton_step(weight, r)) break;
    sweep(r);
    if (!solvable_) return false;
    const double now = error(r);
    if (now <= tolerance) return true;
    if (!std::isfinite(now)) break;
    if (now < 0.3 * best) weight = std::max(0.1 * weight, light);
    if (keep(now, r, best)) {
      worse = 0;
    } else {
      ++worse;
    }
  }
  restore(r);
  return false;
}

/// Solves an island so that its part of the error is at most its contacts' part of the tolerance.
template <int D>
bool SmallSolver<D>::solve_island(std::size_t k, double tolerance, double* r) {
  now_ = island(k);
  const double share =
      islands_ == 1 ? 1.0 : std::sqrt(static_cast<double>(now_.size()) / static_cast<double>(nc_));
  scale_ = share * whole_scale_;
  scaled_scale_ = share * whole_scaled_scale_;
  double least = std::numeric_limits<double>::infinity();
  blocks_now_ = 0;
  bool guessed = false;
  bool separating = true;
  for (const Index a : now_) {
    const auto self = static_cast<std::size_t>(a);
    blocks_now_ += row_[self + 1] - row_[self];
    least = std::min(least, 1 / rho_[self]);
    guessed = guessed || !part(r, a).isZero(0);
    separating = separating && q_[D * a] >= 0;
  }
  close_of_error_ = std::min(scale_, scaled_scale_ * least);
  if (separating) {
    for (const Index a : now_) part(r, a).setZero();
    return true;
  }
  if (guessed) {
    if (meets(tolerance, r) || seek(tolerance, r)) return true;
    if (stopped()) return false;
    for (const Index a : now_) part(r, a).setZero();
  }
  return seek(tolerance, r);
}

/// Improves r on the island until its error is at most the tolerance. If not, r is the best
/// iterate.
template <int D>
bool SmallSolver<D>::seek(double tolerance, double* r) {
  solvable_ = true;
  double change = std::exchange(swept_, -1.0);
  if (change < 0) {
    change = 1;  // about the error of r = 0
    if (project(tolerance, r, change)) return true;
  }
  change = std::min(1.0, change);  // 1 if NaN
  if (contacts_.empty()) {
    for (Index a = 0; a < nc_; ++a) {
      contacts_.emplace_back(diagonal_[static_cast<std::size_t>(a)], mu_[a]);
    }
  }
  double best = std::numeric_limits<double>::infinity();
  double last = 0;
  int attempts = 0;
  int next_attempt = first_sweeps;
  // sweeps; the rate tells little about many of them
  const double worth = std::min(4 * costs().newton / costs().exact, most_foreseen);
  const bool alone = now_.size() == 1;
  double close = closeness * tolerance;
  for (int k = 1; k <= most_sweeps && !stopped(); ++k) {
    close_ = alone ? 0.0 : close_of_error_ * std::max(close, closeness_to_change * change);
    change = sweep(r);
    if (!solvable_ || !std::isfinite(change)) return false;
    if (alone) return true;  // exact: the merit decides
    if (change <= 2 * tolerance) {
      const double now = error(r);
      if (now <= tolerance) return true;
      keep(now, r, best);
      close *= 0.1;  // if the sweeps stop here, this is why
    }
    const double before = last;
    last = change;
    if (k < next_attempt) continue;
    const double rate = std::log(before / change);
    const double left = std::log(change / tolerance) / rate;
    if (rate > 0 && left < worth) continue;
    if (D * now_.size() > most_unknowns || attempts == newton_attempts) {
      if (left > most_sweeps) return false;
      continue;
    }
    keep(error(r), r, best);
    if (newton(attempts++, tolerance, r, best)) return true;
    if (!solvable_) return false;
    next_attempt = k + first_sweeps * attempts * attempts;
    last = 0;
  }
  if (best < std::numeric_limits<double>::infinity()) restore(r);
  return false;
}

template class SmallSolver<2>;
template class SmallSolver<3>;

}  // namespace fclib
