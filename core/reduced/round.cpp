#include "reduced/round.hpp"

#include <utility>

namespace fclib {

namespace {

/// The coefficient of the round cone of a contact. `e` becomes E of its tangential components.
double round_coefficient(double mu, double mu_s, Eigen::Ref<Eigen::Vector3d> e) {
  if (mu > 0) {
    e << 1, 1, mu_s / mu;
    return mu;
  }
  if (!(mu_s > 0)) {
    e.setOnes();
    return 0;
  }
  e << 0, 0, mu_s;
  return 1;
}

/// E W E, with a mean diagonal for the components that E takes away.
Matrix scaled(const Matrix& W, const Vector& scale) {
  constexpr Index d = 4;
  Matrix result = converted(W, Storage::triplet);
  Vector diagonal = Vector::Zero(scale.size());
  std::size_t k = 0;
  for_each_entry(Matrix(result), [&](Index row, Index col, double value) {
    if (row == col) diagonal[row] += value;
    result.x[k++] = scale[row] * value * scale[col];
  });
  for (Index row = 0; row < static_cast<Index>(scale.size()); ++row) {
    if (scale[row] != 0) continue;
    const double mean = diagonal.segment<d>(row - row % d).mean();
    result.i.push_back(row);
    result.p.push_back(row);
    result.x.push_back(mean > 0 ? mean : 1);
  }
  return result;
}

}  // namespace

Round::Round(const Matrix& W, const ReducedProblem& given)
    : scale_(Vector::Ones(given.m())), problem_{.W = given.W, .q = {}, .friction = {}} {
  constexpr int d = 4;
  Vector mu(given.nc());
  for (Index a = 0; a < given.nc(); ++a) {
    mu[a] = round_coefficient(given.friction.mu[a], given.friction.mu_s[a],
                              scale_.segment<3>(d * a + 1));
  }
  problem_.W = BlockMatrix(scaled(W, scale_), d);
  problem_.q = scale_.cwiseProduct(given.q);
  problem_.friction.mu = std::move(mu);
  problem_.scale = given.scale;
  problem_.rho = given.rho;
  problem_.scaled_scale = given.scaled_scale;
  if (given.known_r.size() > 0) {
    problem_.known_r = to_own(given.known_r);
    problem_.known_u = scale_.cwiseProduct(given.known_u);
  }
  if (given.primal != nullptr && (scale_.array() != 0).all()) {
    primal_ = {given.primal->M, given.primal->H * scale_.asDiagonal()};
    problem_.primal = &primal_;
  }
  problem_.deadline = given.deadline;
  problem_.proves_no_solution = given.proves_no_solution;
}

Vector Round::to_own(const Vector& r) const {
  Vector result = r;
  for (Eigen::Index k = 0; k < r.size(); ++k) result[k] = scale_[k] != 0 ? r[k] / scale_[k] : 0;
  return result;
}

}  // namespace fclib
