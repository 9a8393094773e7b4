#include "stepping/contacts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

#include "error.hpp"

namespace fclib::stepping {

namespace {

using Point = std::array<double, 3>;

Point point_of(std::span<const double> points, std::size_t k) {
  return {points[3 * k], points[3 * k + 1], points[3 * k + 2]};
}

Point difference(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

double distance(std::span<const double> one, std::size_t i, std::span<const double> other,
                std::size_t k) {
  const Point apart = difference(point_of(one, i), point_of(other, k));
  return std::sqrt(dot(apart, apart));
}

using Pair = std::pair<std::int64_t, std::int64_t>;

Pair pair_of(std::span<const std::int64_t> pair, std::size_t k) {
  return {pair[2 * k], pair[2 * k + 1]};
}

/// The numbers from 0, ordered by their pairs; equal ones stay in order.
std::vector<std::size_t> by_pair(std::span<const std::int64_t> pair) {
  std::vector<std::size_t> order(pair.size() / 2);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t i, std::size_t k) {
    return pair_of(pair, i) < pair_of(pair, k);
  });
  return order;
}

/// Calls visit(begin, end) for each run of equal pairs in an order by pairs.
template <class Visit>
void for_each_pair(std::span<const std::int64_t> pair, const std::vector<std::size_t>& order,
                   const Visit& visit) {
  for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
    const Pair own = pair_of(pair, order[begin]);
    while (end < order.size() && pair_of(pair, order[end]) == own) ++end;
    visit(begin, end);
  }
}

/// The gaps (nc) that count as closed: what rounding and solvers may make of gaps of 0.
///
/// Coordinate i may be off by the rounding, and by a share of its free motion in a step,
/// h (|v_i| + h |F_i| / M_ii). Errors of solvers are also a share of that.
std::vector<double> closed_gaps(const Reach& reach) {
  const std::size_t nc = reach.gap.size(), n = reach.v.size();
  std::vector<double> closed(nc, 0.0);
  if (!reach.allowance) return closed;
  std::vector<double> off(n);
  for (std::size_t i = 0; i < n; ++i) {
    double own = 0;
    const auto col = static_cast<Index>(i);
    for (Index k = reach.M.start(col); k < reach.M.start(col + 1); ++k) {
      if (reach.M.i[k] == col) own = reach.M.x[k];
    }
    const double free = std::abs(reach.v[i]) + reach.h * std::abs(reach.force[i]) / own;
    off[i] = reach.rounding + reach.motion * reach.h * free;
  }
  for (std::size_t c = 0; c < nc; ++c) {
    const auto col = static_cast<Index>(c) * reach.d;
    for (Index k = reach.H.start(col); k < reach.H.start(col + 1); ++k) {
      closed[c] += std::abs(reach.H.x[k]) * off[static_cast<std::size_t>(reach.H.i[k])];
    }
    const auto [first, second] = pair_of(reach.pair, c);
    if (first >= 0 && !reach.surface.empty()) {
      closed[c] += reach.surface[static_cast<std::size_t>(first)] +
                   reach.surface[static_cast<std::size_t>(second)];
    }
  }
  return closed;
}

}  // namespace

Active active_contacts(const Reach& reach) {
  const std::size_t nc = reach.gap.size();
  const std::vector<double> closed = closed_gaps(reach);
  std::vector<double> before(nc), middle(nc);
  std::vector<std::uint8_t> active(nc);
  for (std::size_t c = 0; c < nc; ++c) {
    before[c] = product(reach.H, static_cast<Index>(c) * reach.d, reach.v);
    middle[c] = reach.gap[c] + 0.5 * reach.h * before[c];
    active[c] = middle[c] <= closed[c];
  }
  if (reach.activation > 0) {
    const std::vector<std::size_t> order = by_pair(reach.pair);
    for_each_pair(reach.pair, order, [&](std::size_t begin, std::size_t end) {
      bool touches = false;
      for (std::size_t k = begin; k < end; ++k) touches = touches || active[order[k]];
      for (std::size_t k = begin; touches && k < end; ++k) {
        if (middle[order[k]] <= reach.activation) active[order[k]] = 1;
      }
    });
  }

  std::vector<std::vector<std::int64_t>> crowded;
  if (reach.allowance) {
    // the order of the active ones by pairs
    std::vector<std::int64_t> pair;
    std::vector<std::size_t> number;
    for (std::size_t c = 0; c < nc; ++c) {
      if (!active[c]) continue;
      number.push_back(c);
      pair.insert(pair.end(), {reach.pair[2 * c], reach.pair[2 * c + 1]});
    }
    const std::vector<std::size_t> order = by_pair(pair);
    std::vector<double> points, off;
    for_each_pair(pair, order, [&](std::size_t begin, std::size_t end) {
      if (end - begin <= 2 || pair[2 * order[begin]] < 0) return;
      if (end - begin > static_cast<std::size_t>(reach.face)) {
        auto& own = crowded.emplace_back();
        for (std::size_t k = begin; k < end; ++k) {
          own.push_back(static_cast<std::int64_t>(number[order[k]]));
        }
        return;
      }
      points.clear();
      off.clear();
      for (std::size_t k = begin; k < end; ++k) {
        const std::size_t c = number[order[k]];
        const auto own = reach.point.subspan(3 * c, 3);
        points.insert(points.end(), own.begin(), own.end());
        off.push_back(closed[c]);
      }
      const std::vector<std::uint8_t> there = not_between(points, off);
      for (std::size_t k = begin; k < end; ++k) active[number[order[k]]] = there[k - begin];
    });
  }

  Active found;
  std::vector<std::int64_t> place(nc, -1);
  for (std::size_t c = 0; c < nc; ++c) {
    if (!active[c]) continue;
    place[c] = static_cast<std::int64_t>(found.which.size());
    found.which.push_back(static_cast<std::int64_t>(c));
    found.before.push_back(before[c]);
    found.closed.push_back(closed[c]);
  }
  for (auto& own : crowded) {
    for (std::int64_t& c : own) c = place[static_cast<std::size_t>(c)];
  }
  found.crowded = std::move(crowded);
  return found;
}

std::vector<std::uint8_t> not_between(std::span<const double> points, std::span<const double> off) {
  const std::size_t count = off.size();
  std::vector<std::uint8_t> there(count, 1);
  for (std::size_t i = 0; i < count; ++i) {
    const Point own = point_of(points, i);
    for (std::size_t first = 0; first < count && there[i]; ++first) {
      if (first == i || !there[first]) continue;
      const Point start = point_of(points, first), arm = difference(own, start);
      for (std::size_t second = first + 1; second < count; ++second) {
        if (second == i || !there[second]) continue;
        const Point along = difference(point_of(points, second), start);
        const double square = std::max(dot(along, along), std::numeric_limits<double>::min());
        const double share = std::clamp(dot(arm, along) / square, 0.0, 1.0);
        const Point rest = {arm[0] - share * along[0], arm[1] - share * along[1],
                            arm[2] - share * along[2]};
        if (std::sqrt(dot(rest, rest)) <= off[i]) {
          there[i] = 0;
          break;
        }
      }
    }
  }
  return there;
}

std::vector<std::int64_t> same_contacts(std::span<const std::int64_t> old_pair,
                                        std::span<const double> old_place,
                                        std::span<const std::int64_t> pair,
                                        std::span<const double> place) {
  const std::size_t count = pair.size() / 2;
  std::vector<std::int64_t> source(count, -1);
  const std::vector<std::size_t> olds = by_pair(old_pair), news = by_pair(pair);
  std::vector<std::tuple<double, std::size_t, std::size_t>> candidates;
  std::size_t from = 0;
  for_each_pair(pair, news, [&](std::size_t begin, std::size_t end) {
    const Pair own = pair_of(pair, news[begin]);
    while (from < olds.size() && pair_of(old_pair, olds[from]) < own) ++from;
    std::size_t to = from;
    while (to < olds.size() && pair_of(old_pair, olds[to]) == own) ++to;
    if (to - from == 1 && end - begin == 1) {
      source[news[begin]] = static_cast<std::int64_t>(olds[from]);
    } else if (to > from) {
      if (old_place.size() != 3 * old_pair.size()) {
        throw Error(ErrorKind::problem, "has not a place for each contact", "state");
      }
      for (std::size_t k = begin; k < end; ++k) {
        for (std::size_t old = from; old < to; ++old) {
          const std::size_t i = news[k], j = olds[old];
          const double far = std::min(distance(place, 2 * i, old_place, 2 * j),
                                      distance(place, 2 * i + 1, old_place, 2 * j + 1));
          // an order takes no NaN
          candidates.emplace_back(std::isnan(far) ? HUGE_VAL : far, i, j);
        }
      }
    }
    from = to;
  });
  // of equally near ones the first
  std::sort(candidates.begin(), candidates.end());
  std::vector<std::uint8_t> taken(old_pair.size() / 2, 0);
  for (const auto& [far, i, j] : candidates) {
    if (source[i] >= 0 || taken[j]) continue;
    source[i] = static_cast<std::int64_t>(j);
    taken[j] = 1;
  }
  return source;
}

std::vector<double> carried_over(std::span<const double> r, std::size_t d,
                                 std::span<const std::int64_t> source,
                                 std::span<const double> old_frame, std::span<const double> frame,
                                 std::size_t force, std::size_t axis) {
  std::vector<double> found(source.size() * d, 0.0);
  for (std::size_t c = 0; c < source.size(); ++c) {
    if (source[c] < 0) continue;
    const auto old = static_cast<std::size_t>(source[c]);
    const std::span<const double> before = r.subspan(d * old, d);
    const std::span<double> now = std::span(found).subspan(d * c, d);
    const std::span<const double> own = frame.subspan(9 * c, 9),
                                  last = old_frame.subspan(9 * old, 9);
    if (std::all_of(own.begin(), own.end(), [](double x) { return x == 0; })) {
      std::copy(before.begin(), before.end(), now.begin());
      continue;
    }
    const auto turn = [&](std::size_t begin, std::size_t end, std::size_t first) {
      Point world{};
      for (std::size_t k = begin; k < end; ++k) {
        for (std::size_t j = 0; j < 3; ++j)
          world[j] += last[3 * (first + k - begin) + j] * before[k];
      }
      for (std::size_t k = begin; k < end; ++k) {
        now[k] = dot(point_of(own, first + k - begin), world);
      }
    };
    turn(0, force, 0);
    turn(force, d, axis);
  }
  return found;
}

void places_on_shapes(std::span<const double> point, std::span<const std::int64_t> pair,
                      std::span<const double> place, std::span<const double> turn,
                      const std::array<double, 2>& period, std::span<double> found) {
  for (std::size_t c = 0; c < pair.size() / 2; ++c) {
    for (std::size_t side = 0; side < 2; ++side) {
      const auto [first, second] = pair_of(pair, c);
      const std::span<double> own = found.subspan(6 * c + 3 * side, 3);
      if (first < 0) {
        std::fill(own.begin(), own.end(), 0.0);
        continue;
      }
      const auto shape = static_cast<std::size_t>(side == 0 ? first : second);
      Point arm = difference(point_of(point, c), point_of(place, shape));
      for (std::size_t k = 0; k < 2; ++k) {
        if (period[k] > 0) arm[k] -= period[k] * std::nearbyint(arm[k] / period[k]);
      }
      const std::span<const double> axes = turn.subspan(9 * shape, 9);
      for (std::size_t k = 0; k < 3; ++k) {
        own[k] = axes[k] * arm[0] + axes[3 + k] * arm[1] + axes[6 + k] * arm[2];
      }
    }
  }
}

}  // namespace fclib::stepping
