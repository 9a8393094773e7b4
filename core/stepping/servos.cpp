#include "stepping/servos.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cstddef>
#include <utility>

#include "error.hpp"
#include "linalg/factorization.hpp"

namespace fclib::stepping {

namespace {

using Doubles = std::vector<double>;

// largest number of steps without contacts: each changes the set of servos at a limit. One or two
// suffice, except if servos act on each other
constexpr int passes = 8;
constexpr Index few = 200;  // up to so many degrees of freedom a full matrix is faster

int sign(double x) { return (x > 0) - (x < 0); }

/// Calls visit(column, moment) for each entry of an output.
template <class Visit>
void for_each_moment(const Moments& moments, std::size_t output, const Visit& visit) {
  const auto start = static_cast<std::size_t>(moments.start[output]);
  for (std::size_t k = start; k < start + static_cast<std::size_t>(moments.length[output]); ++k) {
    visit(static_cast<std::size_t>(moments.column[k]), moments.value[k]);
  }
}

/// The forces on joints (n) of forces of outputs (k).
Doubles on_joints(const Moments& moments, std::span<const double> force, std::size_t n) {
  Doubles joint(n, 0.0);
  for (std::size_t k = 0; k < force.size(); ++k) {
    for_each_moment(moments, k,
                    [&](std::size_t i, double moment) { joint[i] += moment * force[k]; });
  }
  return joint;
}

/// Forces within their limits: of tendons, then outputs, then joints.
///
/// rest   (n) other forces of actuators on the joints
Held clipped(const Servos& servos, const Moments& moments, Doubles force, const Doubles& rest) {
  Held held;
  held.outputs.assign(force.size(), 0);
  for (const Tendon& tendon : servos.tendons) {
    double total = 0;
    for (const std::size_t k : tendon.outputs) total += force[k];
    if (total > tendon.low && total < tendon.high) continue;
    const double bound = total <= tendon.low ? tendon.low : tendon.high;
    for (const std::size_t k : tendon.outputs) {
      force[k] *= total != 0 ? bound / total : 0.0;
      held.outputs[k] = 1;
    }
  }
  for (std::size_t k = 0; k < force.size(); ++k) {
    if (force[k] <= servos.low[k] || force[k] >= servos.high[k]) held.outputs[k] = 1;
    force[k] = std::min(std::max(force[k], servos.low[k]), servos.high[k]);
  }
  const std::size_t n = rest.size();
  held.joint_force = on_joints(moments, force, n);
  held.joints.assign(n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    double& own = held.joint_force[i];
    own += rest[i];
    held.joints[i] = own <= servos.joint_low[i] || own >= servos.joint_high[i];
    own = std::min(std::max(own, servos.joint_low[i]), servos.joint_high[i]);
  }
  held.force = std::move(force);
  return held;
}

/// Those that were at the opposite limit before are now at none.
void free_crossed(std::vector<std::uint8_t>& now, const Doubles& force,
                  const std::vector<std::uint8_t>& before, const Doubles& old) {
  for (std::size_t k = 0; k < now.size(); ++k) {
    if (before[k] && sign(force[k]) != sign(old[k])) now[k] = 0;
  }
}

/// Whether the same ones are at the same limits.
bool same(const std::vector<std::uint8_t>& one, const Doubles& force,
          const std::vector<std::uint8_t>& other, const Doubles& old) {
  for (std::size_t k = 0; k < one.size(); ++k) {
    if (one[k] != other[k] || (one[k] && sign(force[k]) != sign(old[k]))) return false;
  }
  return true;
}

/// A diagonal (n), plus the outer products of the moments of outputs times their gains (k).
Matrix with_servos(const Moments& moments, std::span<const double> diagonal,
                   std::span<const double> gain, const Held* held) {
  struct Entry {
    Index column, row;
    double value;
  };
  const auto n = static_cast<Index>(diagonal.size());
  std::vector<Entry> entries;
  std::vector<std::pair<Index, double>> own;
  for (std::size_t k = 0; k < gain.size(); ++k) {
    if (gain[k] == 0 || (held != nullptr && held->outputs[k])) continue;
    own.clear();
    for_each_moment(moments, k, [&](std::size_t i, double moment) {
      if (held == nullptr || !held->joints[i]) own.emplace_back(static_cast<Index>(i), moment);
    });
    for (const auto& [column, moment] : own) {
      for (const auto& [row, other] : own) {
        entries.push_back({column, row, moment * (other * gain[k])});
      }
    }
  }
  const auto before = [](const Entry& one, const Entry& other) {
    return std::pair(one.column, one.row) < std::pair(other.column, other.row);
  };
  std::stable_sort(entries.begin(), entries.end(), before);
  Matrix base, products;
  for (Matrix* const matrix : {&base, &products}) {
    matrix->storage = Storage::csc;
    matrix->rows = matrix->cols = n;
    matrix->p.push_back(0);
  }
  const auto add = [](Matrix& matrix, Index row, double value) {
    if (value == 0) return;
    matrix.i.push_back(row);
    matrix.x.push_back(value);
  };
  auto entry = entries.cbegin();
  for (Index column = 0; column < n; ++column) {
    add(base, column, diagonal[static_cast<std::size_t>(column)]);
    while (entry != entries.cend() && entry->column == column) {
      const Index row = entry->row;
      double total = 0;
      for (; entry != entries.cend() && entry->column == column && entry->row == row; ++entry) {
        total += entry->value;
      }
      add(products, row, total);
    }
    for (Matrix* const matrix : {&base, &products}) {
      matrix->p.push_back(static_cast<Index>(matrix->i.size()));
    }
  }
  return products.x.empty() ? base : sum(columns_of(base), 1.0, columns_of(products));
}

/// A^-1 b of a symmetric positive definite matrix.
Vector solved(const Matrix& A, const Vector& b) {
  if (A.rows > few) return Factorization(to_eigen(A), "M").solve(b);
  Eigen::MatrixXd full = Eigen::MatrixXd::Zero(A.rows, A.cols);
  for_each_entry(A, [&](Index row, Index col, double value) { full(row, col) += value; });
  const Eigen::LLT<Eigen::MatrixXd> factor(full);
  if (factor.info() != Eigen::Success) {
    throw Error(ErrorKind::unsuitable, "is not positive definite", "M");
  }
  return factor.solve(b);
}

}  // namespace

Linear linear_of(const Servos& servos, const Moments& moments, const Held* held) {
  return {with_servos(moments, servos.dampers, servos.damping, held),
          with_servos(moments, servos.springs, servos.stiffness, held)};
}

Limited within_limits(const Servos& servos, const Moments& moments, std::span<const double> raw,
                      std::span<const double> whole, const Columns& M,
                      std::span<const double> other, std::span<const double> v, double h) {
  const std::size_t n = whole.size(), count = raw.size();
  const Doubles start(raw.begin(), raw.end());
  Doubles rest = on_joints(moments, raw, n);
  for (std::size_t i = 0; i < n; ++i) rest[i] = whole[i] - rest[i];
  // those at a limit have that limit
  const auto force_of = [&](const Held& held) {
    Doubles output = start;
    for (std::size_t k = 0; k < count; ++k) {
      if (held.outputs[k]) output[k] = held.force[k];
    }
    Doubles force = on_joints(moments, output, n);
    for (std::size_t i = 0; i < n; ++i) {
      force[i] = held.joints[i] ? held.joint_force[i] : force[i] + rest[i];
    }
    return force;
  };

  Held held = clipped(servos, moments, start, rest);
  Limited limited;
  for (int pass = 0; pass < passes; ++pass) {
    limited.force = force_of(held);
    limited.linear = linear_of(servos, moments, &held);
    const Matrix damped = sum(M, h, columns_of(limited.linear.C));
    const Matrix A = sum(columns_of(damped), h * h, columns_of(limited.linear.K));
    Doubles pulled(n, 0.0);
    add_product(columns_of(limited.linear.K), v, pulled);
    Vector side(static_cast<Eigen::Index>(n));
    for (std::size_t i = 0; i < n; ++i) {
      side[static_cast<Eigen::Index>(i)] = h * (other[i] + limited.force[i] - h * pulled[i]);
    }
    const Vector change = solved(A, side);
    Doubles reached = start;
    for (std::size_t k = 0; k < count; ++k) {
      double moved = 0, faster = 0;
      for_each_moment(moments, k, [&](std::size_t i, double moment) {
        const double gain = change[static_cast<Eigen::Index>(i)];
        moved += moment * (h * (v[i] + gain));
        faster += moment * gain;
      });
      reached[k] -= servos.stiffness[k] * moved;
      reached[k] -= servos.damping[k] * faster;
    }
    Held found = clipped(servos, moments, std::move(reached), rest);
    free_crossed(found.outputs, found.force, held.outputs, held.force);
    free_crossed(found.joints, found.joint_force, held.joints, held.joint_force);
    if (same(found.outputs, found.force, held.outputs, held.force) &&
        same(found.joints, found.joint_force, held.joints, held.joint_force)) {
      return limited;
    }
    held = std::move(found);
  }
  limited.force = force_of(held);
  limited.linear = linear_of(servos, moments, &held);
  return limited;
}

}  // namespace fclib::stepping
