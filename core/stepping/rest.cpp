#include "stepping/rest.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

namespace fclib::stepping {

namespace {

constexpr double exact = 1e-15;  // of a velocity, relative to the terms that it is a sum of
constexpr int most = 1000;       // steps

std::span<const double> span_of(const Vector& x) {
  return {x.data(), static_cast<std::size_t>(x.size())};
}

Vector times(const Columns& H, const Vector& x) {
  Vector y = Vector::Zero(H.rows);
  add_product(H, span_of(x), {y.data(), static_cast<std::size_t>(y.size())});
  return y;
}

Vector transposed_times(const Columns& H, const Vector& y) {
  Vector x(H.cols);
  for (Index col = 0; col < H.cols; ++col) x[col] = product(H, col, span_of(y));
  return x;
}

}  // namespace

Vector moving_part(const Columns& H, ConstVectorRef change) {
  // conjugate gradients on H^T H x = H^T H change from 0: x stays in the range of H^T. Each row has
  // the length one, as velocities and angular velocities have other sizes
  Vector sizes = Vector::Zero(H.rows), squares = Vector::Zero(H.rows);
  for (Index col = 0; col < H.cols; ++col) {
    for (Index k = H.start(col); k < H.start(col + 1); ++k) {
      sizes[H.i[k]] += std::abs(H.x[k] * change[col]);
      squares[H.i[k]] += H.x[k] * H.x[k];
    }
  }
  const Vector scale =
      squares.unaryExpr([](double square) { return square > 0 ? 1 / std::sqrt(square) : 0.0; });
  const auto moved = [&](const Vector& x) { return Vector(scale.cwiseProduct(times(H, x))); };
  const auto pushed = [&](const Vector& y) { return transposed_times(H, scale.cwiseProduct(y)); };
  const double least = exact * scale.cwiseProduct(sizes).norm();
  Vector part = Vector::Zero(H.cols), left = moved(change);
  Vector gradient = pushed(left), direction = gradient;
  double square = gradient.squaredNorm();
  for (int k = 0; k < most && left.norm() > least && square > 0; ++k) {
    const Vector image = moved(direction);
    const double curvature = image.squaredNorm();
    if (!(curvature > 0)) break;
    const double step = square / curvature;
    part += step * direction;
    left -= step * image;
    gradient = pushed(left);
    const double before = square;
    square = gradient.squaredNorm();
    direction = gradient + square / before * direction;
  }
  return part;
}

std::optional<Vector> nearest_at_rest(const GlobalProblem& problem, const Solution& solution,
                                      ConstVectorRef r, double still) {
  const Index d = problem.spacedim;
  const Index nc = problem.size(Dim::nc);
  // velocities without reactions, except for coupled degrees of freedom
  Vector mass = Vector::Zero(problem.M.rows);
  for_each_entry(problem.M, [&](Index row, Index col, double value) {
    if (row == col) mass[row] += value;
  });
  const double free = (problem.f.array().abs() / mass.array().abs()).maxCoeff();
  std::vector<Index> columns;
  double speed = 0;
  for (Index c = 0; c < nc; ++c) {
    if (!(solution.r[c * d] > 0)) continue;
    for (Index k = c * d; k < (c + 1) * d; ++k) {
      columns.push_back(k);
      speed = std::max(speed, std::abs(solution.u[k]));
    }
  }
  if (columns.empty() || speed > still * free) return std::nullopt;

  const bool by_columns = problem.H.storage == Storage::csc;
  const Matrix other = by_columns ? Matrix() : converted(problem.H, Storage::csc);
  const Matrix H = part(columns_of(by_columns ? problem.H : other), columns);
  std::vector<bool> pushed(static_cast<std::size_t>(H.rows), false);
  for (const Index row : H.i) pushed[static_cast<std::size_t>(row)] = true;
  // they are unique if they are as many as the directions that they push
  if (H.cols <= std::count(pushed.begin(), pushed.end(), true)) return std::nullopt;
  Vector change(H.cols);
  for (Index k = 0; k < H.cols; ++k) change[k] = r[columns[k]] - solution.r[columns[k]];
  change -= moving_part(columns_of(H), change);
  Vector found = solution.r;
  for (Index k = 0; k < H.cols; ++k) found[columns[k]] += change[k];
  return found;
}

}  // namespace fclib::stepping
