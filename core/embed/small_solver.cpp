#include "embed/small_solver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "contact/alart_curnier.hpp"
#include "contact/natural_squares.hpp"
#include "embed/memory.hpp"
#include "merit/natural_sums.hpp"

namespace fclib {

namespace {

constexpr int most_sweeps = 500;
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
constexpr Index few_contacts = 12;
/// Unknowns of the largest system that is factorised here. It is dense.
constexpr Index most_unknowns = 900;

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

}  // namespace

template <int D>
void SmallSolver<D>::resize(Index nc) {
  nc_ = nc;
  const auto count = static_cast<std::size_t>(nc);
  grow(diagonal_, count);
  grow(row_, count + 1);
  grow(rho_, count);
  grow(place_, count);
  for (auto* vector : {&best_, &last_, &z_}) grow(*vector, D * count);
}

template <int D>
void SmallSolver<D>::take(Index nc, const double* W, const double* q, const double* mu) {
  resize(nc);
  q_ = q;
  mu_ = mu;
  const auto count = static_cast<std::size_t>(nc);
  grow(blocks_, count * count);
  grow(column_, count * count);
  std::size_t at = 0;
  const auto m = static_cast<std::ptrdiff_t>(D) * nc;
  for (Index a = 0; a < nc; ++a) {
    row_[static_cast<std::size_t>(a)] = at;
    for (Index b = 0; b < nc; ++b) {
      const Eigen::Map<const Eigen::Matrix<double, D, D, Eigen::RowMajor>, 0, Eigen::OuterStride<>>
          block(W + D * a * m + D * b, Eigen::OuterStride<>(m));
      if (a == b) {
        diagonal_[static_cast<std::size_t>(a)] = block;
      } else {
        bool empty = true;
        for (int i = 0; i < D && empty; ++i) {
          for (int j = 0; j < D; ++j) empty = empty && block(i, j) == 0;
        }
        if (empty) continue;
        blocks_[at] = block;
        column_[at++] = b;
      }
    }
  }
  row_[count] = at;
  prepare();
}

template <int D>
const char* SmallSolver<D>::take(const MatrixView& W, const double* q, const double* mu) {
  const Index nc = W.rows / D;
  resize(nc);
  q_ = q;
  mu_ = mu;
  const auto count = static_cast<std::size_t>(nc);
  // the entries of each contact's rows
  grow(entry_row_, count + 2);
  std::fill(entry_row_.begin(), entry_row_.end(), 0);
  const char* wrong = W.visit([&](Index row, Index, double value) {
    if (value != 0) ++entry_row_[static_cast<std::size_t>(row / D) + 2];
  });
  if (wrong != nullptr) return wrong;
  for (std::size_t a = 2; a < count + 2; ++a) entry_row_[a] += entry_row_[a - 1];
  grow(entries_, entry_row_[count + 1]);
  W.visit([&](Index row, Index col, double value) {
    if (value != 0) {
      entries_[entry_row_[static_cast<std::size_t>(row / D) + 1]++] = {col, value, row % D};
    }
  });
  // blocks of them
  grow(block_of_, count);
  std::fill(block_of_.begin(), block_of_.end(), -1);
  std::size_t at = 0;
  for (Index a = 0; a < nc; ++a) {
    const auto self = static_cast<std::size_t>(a);
    row_[self] = at;
    diagonal_[self].setZero();
    const auto first = static_cast<std::ptrdiff_t>(at);
    for (std::size_t k = entry_row_[self]; k < entry_row_[self + 1]; ++k) {
      const auto [col, value, component] = entries_[k];
      const Index b = col / D;
      if (b == a) {
        diagonal_[self](component, col % D) += value;
        continue;
      }
      std::ptrdiff_t& place = block_of_[static_cast<std::size_t>(b)];
      if (place < first) {
        place = static_cast<std::ptrdiff_t>(at);
        grow(blocks_, at + 1);
        grow(column_, at + 1);
        blocks_[at].setZero();
        column_[at++] = b;
      }
      blocks_[static_cast<std::size_t>(place)](component, col % D) += value;
    }
  }
  row_[count] = at;
  prepare();
  return nullptr;
}

/// The contacts alone, and the scales of the errors.
template <int D>
void SmallSolver<D>::prepare() {
  iterations_ = 0;
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
    contacts_.emplace_back(diagonal_[self], mu_[a]);
    rho_[self] = scales.rho(size_of(a));
    const double square = part(q_, a).squaredNorm();
    squares += square;
    scaled += rho_[self] * rho_[self] * square;
  }
  scale_ = squares > 0 ? std::sqrt(squares) : 1;
  scaled_scale_ = scaled > 0 ? std::sqrt(scaled) : 1;
}

/// (W r + q)_a without W_aa r_a.
template <int D>
typename SmallSolver<D>::Vec SmallSolver<D>::coupled(Index a, const double* r) const {
  Vec u = part(q_, a);
  const auto self = static_cast<std::size_t>(a);
  for (std::size_t k = row_[self]; k < row_[self + 1]; ++k) u += blocks_[k] * part(r, column_[k]);
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
  for (Index a = 0; a < nc_; ++a) {
    const auto self = static_cast<std::size_t>(a);
    Vec next = part(r, a);
    if (!contacts_[self].solve(coupled(a, r), next)) {
      solvable_ = false;
      return 0;
    }
    const double change = (next - part(r, a)).squaredNorm();
    part(r, a) = next;
    natural += change / (rho_[self] * rho_[self]);
    scaled += change;
  }
  ++iterations_;
  return std::max(std::sqrt(natural) / scale_, std::sqrt(scaled) / scaled_scale_);
}

template <int D>
double SmallSolver<D>::error(const double* r) const {
  NaturalSquares<double> squares;
  for (Index a = 0; a < nc_; ++a) {
    const Coulomb<D> cone(mu_[a]);
    const Vec u = velocity(a, r);
    const Vec ra = part(r, a);
    squares.add_plain(cone, u, ra);
    squares.add_scaled(cone, u, ra, rho_[static_cast<std::size_t>(a)]);
  }
  return squares.error(scale_, scaled_scale_);
}

/// Keeps r if it is the best so far. Returns whether it is.
template <int D>
bool SmallSolver<D>::keep(double error, const double* r, double& best) {
  if (!(error < best)) return false;
  best = error;
  std::copy_n(r, D * nc_, best_.begin());
  return true;
}

/// The number of operations, roughly.
template <int D>
double SmallSolver<D>::sweep_cost() const {
  return 200.0 * nc_ + 2.0 * D * D * static_cast<double>(row_[static_cast<std::size_t>(nc_)]);
}
template <int D>
double SmallSolver<D>::newton_cost() const {
  const double n = D * nc_;
  return 2.0 / 3.0 * n * n * n + 6 * n * n + 2 * sweep_cost();
}

/// One step of Newton's method from r. Returns false if its system is singular.
template <int D>
bool SmallSolver<D>::newton_step(double weight_of_mean, double* r) {
  Index count = 0;
  // open contacts are left out
  for (Index a = 0; a < nc_; ++a) {
    const Vec u = velocity(a, r);
    const double rho = rho_[static_cast<std::size_t>(a)];
    const bool open = !(r[D * a] - rho * u[0] > 0);
    place_[static_cast<std::size_t>(a)] = open ? -1 : count++;
  }
  for (Index a = 0; a < nc_; ++a) {
    if (place_[static_cast<std::size_t>(a)] < 0) part(r, a).setZero();
  }
  const Index n = D * count;
  const auto width = static_cast<std::size_t>(n) + 1;
  grow(system_, static_cast<std::size_t>(n) * width);
  std::fill_n(system_.begin(), static_cast<std::size_t>(n) * width, 0.0);
  double trace = 0;
  for (Index a = 0; a < nc_; ++a) trace += 1 / rho_[static_cast<std::size_t>(a)];
  const double weight = weight_of_mean * trace / nc_;
  for (Index a = 0; a < nc_; ++a) {
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
  for (Index a = 0; a < nc_; ++a) {
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
  double weight = nc_ <= few_contacts && attempt == 0 ? light : heavy * std::pow(10, attempt / 2);
  int worse = 0;
  for (int k = 0; k < (1 + attempt) * newton_steps && worse < 3 + 2 * attempt; ++k) {
    if (!newton_step(weight, r)) break;
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
  std::copy_n(best_.begin(), D * nc_, r);
  return false;
}

template <int D>
bool SmallSolver<D>::solve(double tolerance, double* r) {
  solvable_ = true;
  double best = std::numeric_limits<double>::infinity();
  double last = 0;
  int attempts = 0;
  int next_attempt = first_sweeps;
  // sweeps; the rate tells little about many of them
  const double worth = std::min(4 * newton_cost() / sweep_cost(), most_foreseen);
  for (int k = 1; k <= most_sweeps; ++k) {
    const double change = sweep(r);
    if (!solvable_ || !std::isfinite(change)) return false;
    if (nc_ == 1) return true;  // exact: the merit decides
    if (change <= 2 * tolerance) {
      const double now = error(r);
      if (now <= tolerance) return true;
      keep(now, r, best);
    }
    const double rate = std::log(last / change);
    last = change;
    if (k < next_attempt) continue;
    const double left = std::log(change / tolerance) / rate;
    if (rate > 0 && left < worth) continue;
    if (D * nc_ > most_unknowns || attempts == newton_attempts) {
      if (left > most_sweeps) return false;
      continue;
    }
    keep(error(r), r, best);
    if (newton(attempts++, tolerance, r, best)) return true;
    if (!solvable_) return false;
    next_attempt = k + first_sweeps * attempts * attempts;
    last = 0;
  }
  std::copy_n(best_.begin(), D * nc_, r);
  return false;
}

template class SmallSolver<2>;
template class SmallSolver<3>;

}  // namespace fclib
