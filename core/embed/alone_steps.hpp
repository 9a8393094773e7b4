// How contacts without others are solved in lanes; see lane_steps.hpp. Who includes this has, for
// its Wide, the functions
//     lanes_of<Wide>             how many it has
//     gather<Wide>(at, i)        number i behind the place of each lane
//     gather_two(at, i, a, b)    the same, and those behind them
//     scatter<D>(x, to)          D numbers of each lane, one lane behind the other
//     at_most(a, b)              a bit of each lane in which a <= b, so that there is no NaN
#pragma once

#include "embed/alone.hpp"
#include "embed/lane_steps.hpp"
#include "embed/rounding.hpp"

namespace fclib {

/// What so many steps do not solve is for SmallSolver. workshop/tuning/constants.py ("alone") has
/// tried other numbers.
inline constexpr int most_steps_alone = 32;
/// After so many steps, and after twice as many, and so on, a contact is left to SmallSolver at
/// once if its rate says that it needs more steps than these. Tried there too.
inline constexpr int first_look = 8;
/// A contact that approaches at less than this speed has no guess.
inline constexpr double smallest_speed = 1e-300;

/// N numbers of each contact; behind the last contact it comes again.
template <int N, class Wide>
FCLIB_IN_LANES void gather_all(const double* values, int count, Wide* x) {
  constexpr int width = lanes_of<Wide>;
  const double* at[width];
  for (int k = 0; k < width; ++k) at[k] = values + N * (k < count ? k : count - 1);
  for (int i = 0; i + 1 < N; i += 2) gather_two(at, i, x[i], x[i + 1]);
  if constexpr (N % 2 == 1) x[N - 1] = gather<Wide>(at, N - 1);
}

/// The same as scatter, of the lanes that have a bit.
template <int D, class Wide>
FCLIB_IN_LANES void scatter_some(unsigned lanes, const Wide* x, double* to) {
  double all[D * lanes_of<Wide>];
  scatter<D>(x, all);
  for (int k = 0; k < lanes_of<Wide>; ++k) {
    if ((lanes >> k & 1U) == 0) continue;
    for (int i = D * k; i < D * (k + 1); ++i) to[i] = all[i];
  }
}

/// The contacts from `start` on, one in each lane.
template <int D, class Wide>
FCLIB_IN_LANES void solve_lanes_alone(double tolerance, int start, int count,
                                      const LocalArrays& first, Alone& found) {
  const int here = count - start < lanes_of<Wide> ? count - start : lanes_of<Wide>;
  Wide W[D * D];
  Wide q[D];
  Wide r[D];
  Wide mu;
  gather_all<D * D>(first.W + D * D * start, here, W);
  gather_all<D>(first.q + D * start, here, q);
  gather_all<1>(first.mu + start, here, &mu);
  const bool guessed = first.guess != nullptr;
  Wide unread = Wide::Zero();  // NaN if the guess is not finite: a maximum may lose that
  for (int i = 0; i < D; ++i) r[i] = Wide::Zero();
  if (guessed) {
    // r = 0 if the contact opens, else the guess; a speed next to nothing is between them
    const Wide closing = (q[0] * (-1 / smallest_speed)).max(0.0).min(1.0);
    gather_all<D>(first.guess + D * start, here, r);
    for (int i = 0; i < D; ++i) {
      unread += r[i] * 0.0;
      r[i] *= closing;
    }
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
  Wide looked_at = Wide::Zero();  // the error when it was looked at last
  unsigned left = (1U << here) - 1;
  left &= at_most(Wide::Constant(smallest_size), lower) &
          at_most(upper, Wide::Constant(largest_size)) & at_most(Wide::Zero(), mu);
  const unsigned opens = at_most(Wide::Zero(), q[0]);
  const Wide normal = W[0].inverse();
  const Wide tangent = most.inverse();
  const Wide over = (mu * mu + 1).inverse();
  const Wide over_square = square.inverse();
  const Wide over_scale = over_square.sqrt();
  // rho = 1 gives ||F|| as a velocity, and so does F_rho / rho. The less rho is, the larger it is.
  const Wide over_rho = mean.max(1.0);
  const Wide rho = over_rho.inverse();
  constexpr double unit = unit_of_rounding<D>(1);
  Wide u[D];
  for (int i = 0; i < D; ++i) {
    u[i] = q[i];
    for (int j = 0; j < D && guessed; ++j) u[i] += W[D * i + j] * r[j];
  }
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
    const unsigned solved = left & at_most(rounding, Wide::Constant(bounded_rounding * tolerance)) &
                            at_most(bound, Wide::Constant(tolerance));
    left &= ~solved;
    if (steps >= first_look / 2 && (steps & (steps - 1)) == 0) {
      if (steps >= first_look) {
        // as it has gone since half as many steps, it goes on
        const Wide part = error / looked_at;
        Wide foreseen = error;
        for (int k = steps; k < most_steps_alone; k += steps / 2) foreseen = foreseen * part;
        left &= at_most(foreseen, Wide::Constant(tolerance));
      }
      looked_at = error;
    }
    if (solved == 0) continue;
    found.solved |= solved << start;
    for (int k = 0; k < lanes_of<Wide>; ++k) {
      if ((solved >> k & 1U) == 0) continue;
      found.steps[static_cast<unsigned>(start + k)] = (opens >> k & 1U) != 0 ? 0 : steps;
    }
    if (solved == (1U << lanes_of<Wide>)-1) {
      scatter<1>(&bound, found.error.data() + start);
      scatter<D>(r, first.r + D * start);
      if (first.u != nullptr) scatter<D>(u, first.u + D * start);
      continue;
    }
    scatter_some<1>(solved, &bound, found.error.data() + start);
    scatter_some<D>(solved, r, first.r + D * start);
    if (first.u != nullptr) scatter_some<D>(solved, u, first.u + D * start);
  }
}

/// `Few` is for a rest that it has lanes for.
template <int D, class Wide, class Few = Wide>
FCLIB_IN_LANES void solve_all_alone(double tolerance, int count, const LocalArrays& first,
                                    Alone& found) {
  found.solved = 0;
  int start = 0;
  for (; count - start > lanes_of<Few>; start += lanes_of<Wide>) {
    solve_lanes_alone<D, Wide>(tolerance, start, count, first, found);
  }
  if (start < count) solve_lanes_alone<D, Few>(tolerance, start, count, first, found);
}

}  // namespace fclib
