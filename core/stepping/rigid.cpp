#include "stepping/rigid.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace fclib::stepping {

namespace {

/// The coefficient of two directions: their geometric mean if they differ.
double mean(double one, double other) { return one == other ? one : std::sqrt(one * other); }

}  // namespace

ContactTable contacts_of(const Rows& rows, const Detected& contacts, const Limits& limits,
                         const Law& law) {
  std::vector<std::size_t> starts(rows.length.size() + 1, 0);
  for (std::size_t row = 0; row < rows.length.size(); ++row) {
    starts[row + 1] = starts[row] + static_cast<std::size_t>(rows.length[row]);
  }
  const int d = 3 + (law.rolling ? 2 : 0) + (law.spin ? 1 : 0);
  ContactTable table;
  Matrix& H = table.H;
  H.storage = Storage::csc;
  H.rows = rows.columns;
  H.p.push_back(0);
  H.i.reserve(rows.value.size());
  H.x.reserve(rows.value.size());
  const auto add_column = [&](std::ptrdiff_t row) {
    if (row >= 0) {
      const auto own = static_cast<std::size_t>(row);
      for (std::size_t k = starts[own]; k < starts[own + 1]; ++k) {
        if (rows.value[k] == 0) continue;
        H.i.push_back(rows.column[k]);
        H.x.push_back(rows.value[k]);
      }
    }
    H.p.push_back(static_cast<Index>(H.i.size()));
  };
  const auto append = [](auto& values, const auto* more, std::size_t count) {
    values.insert(values.end(), more, more + count);
  };
  const auto coefficient = [&](double value) { return value > law.least ? value : 0.0; };
  // a mocap body, or a body whose joints do not move the point, has rows without entries
  const auto moves = [&](std::ptrdiff_t address) {
    const auto own = static_cast<std::size_t>(address);
    for (std::size_t k = starts[own]; k < starts[own + 3]; ++k) {
      if (rows.value[k] != 0) return true;
    }
    return false;
  };

  for (std::size_t c = 0; c < contacts.count; ++c) {
    const std::ptrdiff_t address = *contacts.address[c];
    const std::int32_t* const shape = contacts.shape[c];
    if (address < 0 || shape[0] < 0 || shape[1] < 0 || !moves(address)) continue;
    const std::int32_t dim = *contacts.dim[c];
    const double* const given = contacts.friction[c];
    const std::array<double, 5> friction{coefficient(given[0]), coefficient(given[1]),
                                         coefficient(given[2]), coefficient(given[3]),
                                         coefficient(given[4])};
    for (int k = 0; k < 3; ++k) add_column(address + k);
    if (law.spin) {
      add_column(dim >= 4 ? address + 3 : -1);
      table.mu_s.push_back(dim >= 4 ? friction[2] : 0.0);
    }
    if (law.rolling) {
      for (int k = 4; k < 6; ++k) add_column(dim == 6 ? address + k : -1);
      table.mu_r.push_back(dim == 6 ? mean(friction[3], friction[4]) : 0.0);
    }
    append(table.pair, shape, 2);
    append(table.point, contacts.point[c], 3);
    append(table.frame, contacts.frame[c], 9);
    table.gap.push_back(*contacts.gap[c]);
    table.mu.push_back(mean(friction[0], friction[1]));
  }
  for (std::size_t row = limits.first; row < limits.first + limits.count; ++row) {
    add_column(static_cast<std::ptrdiff_t>(row));
    for (int k = 1; k < d; ++k) add_column(-1);
    table.pair.push_back(-1 - limits.kind[row]);
    table.pair.push_back(limits.number[row]);
    table.gap.push_back(limits.gap[row]);
  }
  const std::size_t count = table.gap.size();
  table.point.resize(3 * count, 0.0);
  table.frame.resize(9 * count, 0.0);
  for (auto* const values : {&table.mu, &table.mu_r, &table.mu_s}) {
    const bool there = values == &table.mu || (values == &table.mu_r ? law.rolling : law.spin);
    if (there) values->resize(count, 0.0);
  }
  H.cols = static_cast<Index>(H.p.size()) - 1;
  return table;
}

void speeds_of(std::span<const double> twist, std::span<const std::int64_t> body,
               std::span<const double> centre, std::span<const std::int64_t> root,
               std::span<const double> place, std::span<const double> radius,
               std::span<double> speed) {
  for (std::size_t g = 0; g < speed.size(); ++g) {
    const double* const omega = &twist[6 * static_cast<std::size_t>(body[g])];
    const double* const middle = &centre[3 * static_cast<std::size_t>(root[g])];
    const std::array<double, 3> arm{place[3 * g] - middle[0], place[3 * g + 1] - middle[1],
                                    place[3 * g + 2] - middle[2]};
    double square = 0, turning = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t next = (k + 1) % 3, last = (k + 2) % 3;
      const double moved = omega[3 + k] + (omega[next] * arm[last] - omega[last] * arm[next]);
      square += moved * moved;
      turning += omega[k] * omega[k];
    }
    speed[g] = std::sqrt(square) + std::sqrt(turning) * radius[g];
  }
}

void set_margins(std::span<const double> own, std::span<const double> reach,
                 std::span<const std::int64_t> owner, std::span<const std::int64_t> first,
                 const Margins& margins) {
  // NaN wins
  const auto larger = [](double a, double b) { return a >= b || std::isnan(a) ? a : b; };
  const std::span<double> all = margins.geometry;
  for (std::size_t g = 0; g < all.size(); ++g) all[g] = larger(own[g], reach[g]);
  std::fill(margins.body.begin(), margins.body.end(), 0.0);
  for (std::size_t k = 0; k < owner.size(); ++k) {
    const auto start = static_cast<std::size_t>(first[k]);
    const auto past = k + 1 < first.size() ? static_cast<std::size_t>(first[k + 1]) : all.size();
    margins.body[static_cast<std::size_t>(owner[k])] =
        std::accumulate(all.begin() + static_cast<std::ptrdiff_t>(start) + 1,
                        all.begin() + static_cast<std::ptrdiff_t>(past), all[start], larger);
  }
}

}  // namespace fclib::stepping
