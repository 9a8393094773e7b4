#include "embed/lanes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "embed/rounding.hpp"
#include "error_size.hpp"

namespace fclib {

namespace {

/// A sweep in lanes costs this part of one of a problem alone.
constexpr double part_of_sweep = 0.3;
/// A contact without others that so many steps do not solve has tangents that differ, or a normal
/// that they change.
constexpr int most_steps_alone = 2;
/// A contact that approaches at less than this speed has no guess.
constexpr double smallest_speed = 1e-300;
/// Instead of 0 in a denominator.
constexpr double tiny = 1e-300;

template <int D, class Wide>
EIGEN_ALWAYS_INLINE Wide tangential_norm(const Wide* x) {
  Wide square = x[1] * x[1];
  if constexpr (D == 3) square += x[2] * x[2];
  return square.sqrt();
}

/// The square of the natural map with rho, as in contact/coulomb.hpp, in each lane. The projection
/// is chosen by minima and maxima, without a branch. Its rounding is that of u^ = u + mu ||u_T||.
template <int D, class Wide>
EIGEN_ALWAYS_INLINE Wide map_square(const Wide& mu, const Wide& over, const Wide& slip,
                                    const Wide& rho, const Wide* u, const Wide* r) {
  Wide y[D];
  for (int i = 1; i < D; ++i) y[i] = r[i] - rho * u[i];
  y[0] = r[0] - rho * (u[0] + slip);
  const Wide norm = tangential_norm<D>(y);
  const Wide normal = ((y[0] + mu * norm) * over).max(y[0]).max(Wide::Zero());
  const Wide scale = (mu * normal / norm.max(tiny)).min(1.0);
  const Wide left = r[0] - normal;
  Wide square = left * left;
  for (int i = 1; i < D; ++i) {
    const Wide by = r[i] - scale * y[i];
    square += by * by;
  }
  return square;
}

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

/// r moved against u, and put on the disk of its normal part.
template <int D, class Wide>
EIGEN_ALWAYS_INLINE void projected_step(const Wide& normal, const Wide& tangent, const Wide& mu,
                                        const Wide* u, Wide* r) {
  r[0] = (r[0] - normal * u[0]).max(0.0);
  for (int i = 1; i < D; ++i) r[i] -= tangent * u[i];
  const Wide scale = (mu * r[0] / tangential_norm<D>(r).max(tiny)).min(1.0);
  for (int i = 1; i < D; ++i) r[i] *= scale;
}

}  // namespace

template <int D>
std::array<typename Lanes<D>::Answer, Lanes<D>::width> Lanes<D>::solve_alone(
    double tolerance, int count, const LocalArrays& first) {
  std::array<Answer, width> answers;
  // of each lane; behind the last problem it comes again
  const auto spread = [count](const double* values, int by) {
    const auto at = [=](int k) { return values[by * std::min(k, count - 1)]; };
    return Wide(at(0), at(1), at(2), at(3));
  };
  Wide W[D * D];
  Wide q[D];
  Wide r[D];
  for (int i = 0; i < D * D; ++i) W[i] = spread(first.W + i, D * D);
  for (int i = 0; i < D; ++i) q[i] = spread(first.q + i, D);
  const Wide mu = spread(first.mu, 1);
  Wide unread = Wide::Zero();  // NaN if the guess is not finite: a maximum may lose that
  // r = 0 if the contact opens, else the guess; a speed next to nothing is between them
  const Wide closing = (q[0] * (-1 / smallest_speed)).max(0.0).min(1.0);
  for (int i = 0; i < D; ++i) {
    r[i].setZero();
    if (first.guess == nullptr) continue;
    const Wide guess = spread(first.guess + i, D);
    unread += guess * 0.0;
    r[i] = guess * closing;
  }
  Wide sizes = W[0].abs();
  Wide most = W[D + 1];
  Wide square = q[0] * q[0];
  for (int i = 1; i < D; ++i) {
    sizes += W[(D + 1) * i].abs();
    most = most.max(W[(D + 1) * i]);
    square += q[i] * q[i];
  }
  const Wide mean = sizes * (1.0 / D);
  // all of them have squares that are safe; what is not finite makes the bound NaN
  const Wide lower = W[0].min(most).min(mean).min(square);
  const Wide upper = mean.max(square);
  const Wide normal = W[0].inverse();
  const Wide tangent = most.inverse();
  const Wide over = (mu * mu + 1).inverse();
  const Wide over_square = square.inverse();
  const Wide over_scale = over_square.sqrt();
  // rho = 1 gives ||F|| as a velocity, and so does F_rho / rho. The less rho is, the larger it is.
  const Wide over_rho = mean.max(1.0);
  const Wide rho = over_rho.inverse();
  const double unit = unit_of_rounding<D>(1);
  Wide u[D];
  for (int i = 0; i < D; ++i) {
    u[i] = q[i];
    for (int j = 0; j < D && first.guess != nullptr; ++j) u[i] += W[D * i + j] * r[j];
  }
  unsigned left = (1U << count) - 1;
  for (int steps = 1; steps <= most_steps_alone && left != 0; ++steps) {
    projected_step<D>(normal, tangent, mu, u, r);
    // and the sizes of the terms of u, of the slip that is rounding and of r
    Wide terms = unread;
    Wide lengths = Wide::Zero();
    for (int i = 0; i < D; ++i) {
      u[i] = q[i];
      terms += q[i].abs() * 2;
      for (int j = 0; j < D; ++j) {
        const Wide product = W[D * i + j] * r[j];
        u[i] += product;
        terms += product.abs();
      }
      lengths += r[i].abs();
    }
    const Wide slip = mu * tangential_norm<D>(u);
    const Wide map = map_square<D>(mu, over, slip, rho, u, r) * (over_rho * over_rho);
    const Wide down = u[0].min(0.0);
    const Wide error = (map.max(down * down) * over_square).sqrt();
    // as BoundedError has it; as an impulse the map is no more than as a velocity
    const Wide rounding = unit * (error + (mu + 1) * (terms + lengths * over_rho) * over_scale);
    const Wide bound = error + rounding;
    for (int k = 0; k < count; ++k) {
      if ((left >> k & 1U) == 0) continue;
      if (!(rounding[k] <= bounded_excess * tolerance && bound[k] <= tolerance)) continue;
      if (!(lower[k] >= smallest_size && upper[k] <= largest_size && mu[k] >= 0)) continue;
      left &= ~(1U << k);
      answers[k].solved = true;
      answers[k].error = bound[k];
      answers[k].sweeps = q[0][k] >= 0 ? 0 : steps;
      for (int i = 0; i < D; ++i) first.r[D * k + i] = r[i][k];
      for (int i = 0; i < D && first.u != nullptr; ++i) first.u[D * k + i] = u[i][k];
    }
  }
  return answers;
}

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
  return rounding <= bounded_excess * tolerance_;
}

template class Lanes<2>;
template class Lanes<3>;

}  // namespace fclib
