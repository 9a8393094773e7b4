#include "reduced/round.hpp"

#include <utility>
#include <vector>

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

/// The diagonal of W~ for the components that E takes away: the mean of what E leaves of the
/// contact; else 0.
Vector own_diagonal(const Matrix& W, const Vector& scale) {
  constexpr Eigen::Index d = 4;
  Vector diagonal = Vector::Zero(scale.size());
  for_each_entry(W, [&](Index row, Index col, double value) {
    if (row == col) diagonal[row] += scale[row] * value * scale[row];
  });
  Vector result = Vector::Zero(scale.size());
  for (Eigen::Index row = 0; row < scale.size(); ++row) {
    if (scale[row] != 0) continue;
    const Eigen::Index first = row - row % d;
    const double kept = static_cast<double>((scale.segment<d>(first).array() != 0).count());
    const double mean = diagonal.segment<d>(first).sum() / kept;
    result[row] = mean > 0 ? mean : 1;
  }
  return result;
}

/// E W E, with a diagonal of its own.
Matrix scaled(const Matrix& W, const Vector& scale, const Vector& own) {
  Matrix result = converted(W, Storage::triplet);
  std::size_t k = 0;
  for_each_entry(Matrix(result), [&](Index row, Index col, double value) {
    result.x[k++] = scale[row] * value * scale[col];
  });
  for (Index row = 0; row < static_cast<Index>(own.size()); ++row) {
    if (own[row] == 0) continue;
    result.i.push_back(row);
    result.p.push_back(row);
    result.x.push_back(own[row]);
  }
  return result;
}

/// The bodies of W~: each component that E takes away moves a mass of its own.
Primal scaled(const Primal& given, const Vector& scale, const Vector& own) {
  using Entry = Eigen::Triplet<double, Index>;
  std::vector<Entry> mass;
  std::vector<Entry> directions;
  auto n = static_cast<Index>(given.M.rows());
  for (Index col = 0; col < n; ++col) {
    for (SparseColumns::InnerIterator at(given.M, col); at; ++at) {
      mass.emplace_back(static_cast<Index>(at.row()), col, at.value());
    }
  }
  for (Index col = 0; col < static_cast<Index>(given.H.cols()); ++col) {
    if (own[col] != 0) {
      mass.emplace_back(n, n, 1 / own[col]);
      directions.emplace_back(n++, col, 1.0);
      continue;
    }
    for (SparseColumns::InnerIterator at(given.H, col); at; ++at) {
      directions.emplace_back(static_cast<Index>(at.row()), col, at.value() * scale[col]);
    }
  }
  Primal result{SparseColumns(n, n), SparseColumns(n, given.H.cols())};
  result.M.setFromTriplets(mass.begin(), mass.end());
  result.H.setFromTriplets(directions.begin(), directions.end());
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
  const Vector own = own_diagonal(W, scale_);
  problem_.W = BlockMatrix(scaled(W, scale_, own), d);
  problem_.q = scale_.cwiseProduct(given.q);
  problem_.friction.mu = std::move(mu);
  problem_.scale = given.scale;
  problem_.rho = given.rho;
  problem_.scaled_scale = given.scaled_scale;
  if (given.known_r.size() > 0) {
    problem_.known_r = to_own(given.known_r);
    problem_.known_u = scale_.cwiseProduct(given.known_u);
  }
  if (given.primal != nullptr) {
    primal_ = scaled(*given.primal, scale_, own);
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
