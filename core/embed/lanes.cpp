#include "embed/lanes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "embed/lane_steps.hpp"
#include "embed/rounding.hpp"
#include "error_size.hpp"

namespace fclib {

namespace {

/// A sweep in lanes costs this part of one of a problem alone. workshop/tuning/constants.py
/// ("batches") has tried other numbers.
constexpr double part_of_sweep = 0.3;

/// Whether W (m x m) of `nc` contacts has no block of zeros. Else it may have islands, and there is
/// less to compute.
template <int D>
bool is_full(int nc, const double* W) {
  const int m = D * nc;
  for (int row = 0; row < m; row += D) {
    for (int column = 0; column < m; column += D) {
      const double* const block = W + row * m + column;
      bool empty = block[0] == 0;
      for (int k = 1; empty && k < D * D; ++k) empty = block[k / D * m + k % D] == 0;
      if (empty) return false;
    }
  }
  return true;
}

/// q + W r of a contact, whose rows (D x m) are `rows`; two columns at a time.
template <int D>
EIGEN_ALWAYS_INLINE void add_rows(int m, const double* rows, const double* q, const double* r,
                                  double* sums) {
  using Two = Eigen::Array2d;
  Two pairs[D];
  for (int i = 0; i < D; ++i) pairs[i].setZero();
  int j = 0;
  for (; j + 1 < m; j += 2) {
    const Two both = Eigen::Map<const Two>(r + j);
    for (int i = 0; i < D; ++i) pairs[i] += Eigen::Map<const Two>(rows + i * m + j) * both;
  }
  for (int i = 0; i < D; ++i) {
    sums[i] = q[i] + pairs[i].sum();
    if (j < m) sums[i] += rows[i * m + j] * r[j];
  }
}

}  // namespace

template <int D>
Lanes<D>::Lanes() {
  for (Wide& entries : W_) entries.setZero();
  for (auto* values : {&over_, &scaled_over_}) values->setZero();
  for (auto* values : {&mu_, &normal_, &tangent_, &square_}) {
    for (Wide& of : *values) of.setZero();
  }
}

template <int D>
void Lanes<D>::begin(double tolerance, Index nc) {
  tolerance_ = tolerance;
  nc_ = static_cast<int>(nc);
  root_ = std::sqrt(static_cast<double>(nc));
  const auto count = static_cast<std::size_t>(nc);
  rule_ = SweepRule(StepCosts(D, count, count * (count - 1)), part_of_sweep);
  for (int lane = 0; lane < width; ++lane) clear(lane);
}

/// Leaves a lane empty: its r stays 0.
template <int D>
void Lanes<D>::clear(int lane) {
  lanes_[lane].k = -1;
  for (int k = 0; k < D * nc_; ++k) q_[k][lane] = r_[k][lane] = 0;
}

/// Puts a problem into a lane. Returns false if SmallSolver has to look at its data.
template <int D>
bool Lanes<D>::load(int number, std::int64_t k, const LocalArrays& arrays) {
  Lane& lane = lanes_[number];
  const int m = D * nc_;
  if (!is_full<D>(nc_, arrays.W)) return false;
  const auto all = [](const double* x, int size) {
    return Eigen::Map<const Eigen::VectorXd>(x, size).squaredNorm();
  };
  const double size_of_W = all(arrays.W, m * m);
  lane.friction = 0;
  lane.least = std::numeric_limits<double>::infinity();
  lane.most = 0;
  double squares = 0;
  double scaled = 0;
  bool fits = true;
  for (int a = 0; a < nc_; ++a) {
    const double* const block = arrays.W + (m + 1) * D * a;
    const double* const q = arrays.q + D * a;
    const double mu = arrays.mu[a];
    double size = std::abs(block[0]);
    double most = 0;
    double square = q[0] * q[0];
    for (int i = 1; i < D; ++i) {
      const double own = block[(m + 1) * i];
      size += std::abs(own);
      most = std::max(most, own);
      square += q[i] * q[i];
    }
    size /= D;
    fits = fits && mu >= 0 && std::isfinite(mu) && has_square(block[0]) && has_square(most);
    const double rho = 1 / size;
    lane.friction = std::max(lane.friction, mu);
    lane.rho[a] = rho;
    lane.size_of[a] = size;
    lane.least = std::min(lane.least, size);
    lane.most = std::max(lane.most, size);
    squares += square;
    scaled += rho * rho * square;
    mu_[a][number] = mu;
    normal_[a][number] = 1 / block[0];
    tangent_[a][number] = 1 / most;
    square_[a][number] = size * size;
  }
  lane.size = std::sqrt(size_of_W);
  lane.scale = std::sqrt(squares);
  lane.scaled_scale = std::sqrt(scaled);
  // what is not finite has no square
  fits = fits && has_square(lane.size) && has_square(lane.scale) && has_square(lane.scaled_scale) &&
         (arrays.guess == nullptr || std::isfinite(all(arrays.guess, m)));
  if (!fits) {
    for (auto* values : {&mu_, &normal_, &tangent_, &square_}) {
      for (int a = 0; a < nc_; ++a) (*values)[a][number] = 0;
    }
    return false;
  }
  over_[number] = 1 / squares;
  scaled_over_[number] = 1 / scaled;
  double* to = W_[0].data() + number;
  for (int a = 0; a < nc_; ++a) {
    const double* const rows = arrays.W + D * a * m;
    for (int j = 0; j < m; ++j) {
      for (int i = 0; i < D; ++i) {
        *to = rows[i * m + j];
        to += width;
      }
    }
  }
  for (int j = 0; j < m; ++j) {
    q_[j][number] = arrays.q[j];
    r_[j][number] = arrays.guess == nullptr ? 0 : arrays.guess[j];
  }
  lane.k = k;
  lane.arrays = arrays;
  lane.sweeps = 0;
  lane.last = 0;
  return true;
}

/// A sweep in all lanes.
template <int D>
void Lanes<D>::sweep() {
  const int m = D * nc_;
  Wide natural = Wide::Zero();
  Wide scaled = Wide::Zero();
  for (int a = 0; a < nc_; ++a) {
    Wide u[D];
    for (int i = 0; i < D; ++i) u[i] = q_[D * a + i];
    const Wide* const rows = W_.data() + D * a * m;
    const auto add = [&](int j) {
      for (int i = 0; i < D; ++i) u[i] += rows[D * j + i] * r_[j];
    };
    // the contact before comes last: the other terms do not wait for it
    for (int j = D * a; j < m; ++j) add(j);
    for (int j = 0; j < D * a; ++j) add(j);
    Wide next[D];
    for (int i = 0; i < D; ++i) next[i] = r_[D * a + i];
    projected_step<D>(normal_[a], tangent_[a], mu_[a], u, next);
    Wide change = Wide::Zero();
    for (int i = 0; i < D; ++i) {
      const Wide by = next[i] - r_[D * a + i];
      change += by * by;
      r_[D * a + i] = next[i];
    }
    natural += change * square_[a];
    scaled += change;
  }
  change_ = (natural * over_).max(scaled * scaled_over_).sqrt();
}

/// Whether the problem of a lane needs no more sweeps here.
template <int D>
bool Lanes<D>::ends(int number, Answer& answer) {
  Lane& lane = lanes_[number];
  const double change = change_[number];
  const int k = ++lane.sweeps;
  const bool near = SweepRule::is_near(k, change, tolerance_);
  const auto take = [&](double* r) {
    for (int j = 0; j < D * nc_; ++j) r[j] = r_[j][number];
  };
  std::array<double, most_rows> r;
  if (near) {
    std::array<double, most_rows> u;
    take(r.data());
    double error = 0;
    double bound = 0;
    if (judge(lane, r.data(), u.data(), error, bound)) {
      answer.solved = bound <= tolerance_;
      answer.error = bound;
      if (answer.solved && lane.arrays.u != nullptr) {
        std::copy_n(u.data(), D * nc_, lane.arrays.u);
      }
    }
    if (error <= tolerance_) {
      std::copy_n(r.data(), D * nc_, lane.arrays.r);
      answer.sweeps = k;
      answer.started = true;
      answer.change = change;
      return true;
    }
  }
  if (k < SweepRule::most && rule_.goes_on(k, lane.last, change, tolerance_)) {
    lane.last = change;
    return false;
  }
  if (std::isfinite(change)) {
    take(lane.arrays.r);
    answer.sweeps = k;
    answer.started = true;
    answer.change = change;
  }
  return true;
}

/// The error of r, and a bound on it; u is W r + q. Returns whether the bound is near the error.
template <int D>
bool Lanes<D>::judge(const Lane& lane, const double* r, double* u, double& error,
                     double& bound) const {
  constexpr int groups = (static_cast<int>(most_contacts) + width - 1) / width;
  const int m = D * nc_;
  Wide wide_u[groups][D];
  Wide wide_r[groups][D];
  Wide wide_mu[groups];
  Wide wide_rho[groups];
  Wide wide_size[groups];
  for (int group = 0; group < groups; ++group) {
    for (int i = 0; i < D; ++i) wide_u[group][i] = wide_r[group][i] = Wide::Zero();
    wide_mu[group] = Wide::Zero();
    wide_rho[group] = wide_size[group] = Wide::Ones();
  }
  double lengths = 0;
  for (int a = 0; a < nc_; ++a) {
    double sums[D];
    add_rows<D>(m, lane.arrays.W + D * a * m, lane.arrays.q + D * a, r, sums);
    const int group = a / width;
    const int place = a % width;
    for (int i = 0; i < D; ++i) {
      u[D * a + i] = sums[i];
      wide_u[group][i][place] = sums[i];
      wide_r[group][i][place] = r[D * a + i];
      lengths += r[D * a + i] * r[D * a + i];
    }
    wide_mu[group][place] = lane.arrays.mu[a];
    wide_rho[group][place] = lane.rho[a];
    wide_size[group][place] = lane.size_of[a];
  }
  Wide plain = Wide::Zero();
  Wide impulses = Wide::Zero();
  Wide velocities = Wide::Zero();
  for (int group = 0; group * width < nc_; ++group) {
    const Wide& mu = wide_mu[group];
    const Wide& rho = wide_rho[group];
    const Wide over = (mu * mu + 1).inverse();
    const Wide slip = mu * tangential_norm<D>(wide_u[group]);
    plain += map_square<D>(mu, over, slip, Wide(Wide::Ones()), wide_u[group], wide_r[group]);
    const Wide square = map_square<D>(mu, over, slip, rho, wide_u[group], wide_r[group]);
    const Wide down = wide_u[group][0].min(0.0);
    impulses += square;
    velocities += (square * wide_size[group] * wide_size[group]).max(down * down);
  }
  const double scale = lane.scale;
  error = larger_error(std::sqrt(larger_error(plain.sum(), velocities.sum())) / scale,
                       std::sqrt(impulses.sum()) / lane.scaled_scale);
  // as BoundedError has it; the sizes of all terms of u are at most ||q|| + ||W|| ||r||
  const double length = std::sqrt(lengths);
  const double size = root_ * length;
  const double speed = root_ * (scale + lane.size * length) + nc_ * scale;
  const double unit = unit_of_rounding<D>(nc_);
  const double rounding =
      unit *
      (error + (1 + lane.friction) * larger_error((speed + size * std::max(1.0, lane.most)) / scale,
                                                  (speed / lane.least + size) / lane.scaled_scale));
  bound = error + rounding;
  if (!std::isfinite(lengths)) error = std::numeric_limits<double>::infinity();
  return rounding <= bounded_rounding * tolerance_;
}

template class Lanes<2>;
template class Lanes<3>;

}  // namespace fclib
