#include "convert/eliminate.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "linalg/dependent_columns.hpp"
#include "linalg/extended.hpp"
#include "number_text.hpp"

namespace fclib {

namespace {

/// Condition number of R with a diagonal of ones. W' loses as many digits.
constexpr double ill_conditioned = 1e10;
/// If less than this share of a constraint is left beside the others, it is rounding.
constexpr double dependent = 1e-12;
/// Constraints that follow from others must agree with them up to this, relative to their terms.
constexpr double agreement = 1e-9;

/// A lower bound, mostly a good one, of the condition number of R scaled to a diagonal of ones.
double condition(const Factorization& factors, const SparseColumns& r) {
  const Eigen::Index p = r.rows();
  Vector scale = r.diagonal().cwiseAbs().cwiseSqrt();
  for (double& x : scale) {
    if (!(x > 0)) x = 1;
  }
  Vector sums = Vector::Zero(p);
  for (Eigen::Index col = 0; col < p; ++col) {
    for (SparseColumns::InnerIterator at(r, col); at; ++at) {
      sums[col] += std::abs(at.value()) / (scale[at.row()] * scale[col]);
    }
  }
  Vector x(p);
  for (Eigen::Index k = 0; k < p; ++k) {  // a vector without any symmetry of the constraints
    x[k] = (k % 2 == 0 ? 1.0 : -1.0) * (1 + 0.7 * std::sin(static_cast<double>(k + 1)));
  }
  double growth = 0;
  for (int k = 0; k < 4; ++k) {
    x /= x.norm();
    x = scale.cwiseProduct(factors.solve(Vector(scale.cwiseProduct(x))));
    growth = x.norm();
    if (!std::isfinite(growth)) return std::numeric_limits<double>::infinity();
    if (growth == 0) break;
  }
  return growth * sums.maxCoeff();
}

SparseColumns selected(const SparseColumns& a, const std::vector<Index>& columns) {
  SparseColumns result(a.rows(), static_cast<Eigen::Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) {
    result.col(static_cast<Eigen::Index>(k)) = a.col(columns[k]);
  }
  return result;
}

Vector selected(const Vector& a, const std::vector<Index>& places) {
  Vector result(static_cast<Eigen::Index>(places.size()));
  for (std::size_t k = 0; k < places.size(); ++k) {
    result[static_cast<Eigen::Index>(k)] = a[places[k]];
  }
  return result;
}

SparseColumns transposed(const SparseColumns& a) { return a.transpose(); }

/// W - V X, and the sizes of the terms of its diagonal. What the bilateral constraints hold
/// entirely is zero; it must not be the rounding of a difference: an entry is left out if it is at
/// most `rounding` times its terms.
std::pair<SparseColumns, Vector> difference(const SparseColumns& w, const SparseColumns& v,
                                            const SparseColumns& x, double rounding) {
  const Eigen::Index m = w.rows();
  std::pair<SparseColumns, Vector> result{SparseColumns(m, m), Vector::Zero(m)};
  auto& [left, sizes] = result;
  Vector given = Vector::Zero(m);  // a column of W, and of V X
  Vector held = Vector::Zero(m);
  std::vector<char> filled(static_cast<std::size_t>(m), 0);
  std::vector<Index> rows;
  const auto fill = [&](Eigen::Index row) {
    if (std::exchange(filled[static_cast<std::size_t>(row)], 1) == 0) {
      rows.push_back(static_cast<Index>(row));
    }
  };
  for (Eigen::Index col = 0; col < m; ++col) {
    for (SparseColumns::InnerIterator at(w, col); at; ++at) {
      fill(at.row());
      given[at.row()] = at.value();
    }
    for (SparseColumns::InnerIterator factor(x, col); factor; ++factor) {
      for (SparseColumns::InnerIterator at(v, factor.row()); at; ++at) {
        fill(at.row());
        held[at.row()] += at.value() * factor.value();
      }
    }
    // to sort them takes some n log2(n) steps for n rows, to look for them m
    if (rows.size() * static_cast<std::size_t>(std::bit_width(rows.size())) > filled.size()) {
      rows.clear();
      for (Index row = 0; row < static_cast<Index>(m); ++row) {
        if (filled[static_cast<std::size_t>(row)] != 0) rows.push_back(row);
      }
    } else {
      std::sort(rows.begin(), rows.end());
    }
    sizes[col] = std::abs(given[col]) + std::abs(held[col]);
    left.startVec(col);
    for (const Index row : rows) {
      const double value = given[row] - held[row];
      if (std::abs(value) > rounding * (std::abs(given[row]) + std::abs(held[row]))) {
        left.insertBack(row, col) = value;
      }
      given[row] = held[row] = 0;
      filled[static_cast<std::size_t>(row)] = 0;
    }
    rows.clear();
  }
  left.finalize();
  return result;
}

/// The constraint that follows from others and contradicts them most, if it does so by more than
/// rounding: by more than a part of its terms. The first `rounding` [m/s] does not count.
std::optional<Error> disagreement(const std::vector<Index>& dropped, const Vector& gap,
                                  const Vector& size, double rounding = 0) {
  Eigen::Index worst = -1;
  double most = agreement;
  for (Eigen::Index k = 0; k < gap.size(); ++k) {
    const double left = std::max(0.0, std::abs(gap[k]) - rounding);
    const double relative = left / (size[k] > 0 ? size[k] : 1.0);
    if (!(relative <= most)) {
      most = relative;
      worst = k;
    }
  }
  if (worst < 0) return std::nullopt;
  return Error(ErrorKind::unsuitable,
               "contradicts the others, from which it follows: if they hold, it is off by " +
                   shortest(std::abs(gap[worst])) + ", " + shortest(most) + " of its terms",
               "bilateral constraint " + std::to_string(dropped[static_cast<std::size_t>(worst)]));
}

}  // namespace

Elimination::Elimination(const LocalProblem& problem, const Deadline* deadline)
    : Elimination(problem, nullptr, nullptr, deadline) {}

Elimination::Elimination(const GlobalProblem& problem, const Condensation& condensation,
                         const Deadline* deadline)
    : Elimination(condensation.local(), &problem, &condensation, deadline) {}

Elimination::Elimination(const LocalProblem& problem, const GlobalProblem* bodies,
                         const Condensation* condensation, const Deadline* deadline)
    : problem_(problem) {
  plain_.spacedim = problem.spacedim;
  plain_.mu = problem.mu;
  plain_.info = problem.info;
  plain_.geometry = problem.geometry;
  const SparseColumns r = to_eigen(problem.R);
  v_ = to_eigen(problem.V);
  s_ = problem.s;
  try {
    bilateral_.emplace(r, "R", false);
  } catch (const Error&) {
    bilateral_.reset();
  }
  const auto too_late = [&] { return deadline != nullptr && deadline->passed(); };
  if (too_late()) return;
  if (!bilateral_ || condition(*bilateral_, r) > ill_conditioned) {
    Vector size = problem.s.cwiseAbs();
    if (bodies != nullptr) {  // s is a sum of these
      const Vector velocity = condensation->mass().solve(bodies->f).cwiseAbs();
      size = bodies->b.cwiseAbs() + to_eigen(bodies->G).cwiseAbs().transpose() * velocity;
    }
    const bool changed = (bodies != nullptr && orthonormalise(*bodies, *condensation)) ||
                         leave_out_redundant(r, size);
    if (!changed && !bilateral_) throw Error(ErrorKind::unsuitable, "R is singular");
  }
  if (too_late()) return;
  reduce();
  finished_ = true;
}

bool Elimination::orthonormalise(const GlobalProblem& bodies, const Condensation& condensation) {
  const Factorization& mass = condensation.mass();
  const std::optional<SparseColumns> a = mass.half(to_eigen(bodies.G));
  if (!a || !small_enough_for_dense(*a)) return false;
  const OrthonormalColumns basis = orthonormal_columns(*a, dependent);
  const auto rank = basis.Q.cols();
  const auto count = static_cast<Eigen::Index>(basis.rows.size());

  const Vector b = basis.scale.cwiseProduct(bodies.b);
  const auto triangle = basis.T1.triangularView<Eigen::Upper>();
  const Vector beta = triangle.transpose().solve(selected(b, basis.columns.kept));
  const Vector dropped = selected(b, basis.columns.dropped);
  const Vector size = dropped.cwiseAbs() + basis.T2.cwiseAbs().transpose() * beta.cwiseAbs();
  const Vector free = *mass.half(SparseColumns(bodies.f.sparseView()));
  Vector free_rows(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    free_rows[k] = free[basis.rows[static_cast<std::size_t>(k)]];
  }
  // no velocity satisfies a constraint better than this, since the columns have length one
  constexpr double rounding_unit = 32 * std::numeric_limits<double>::epsilon();
  contradiction_ = disagreement(basis.columns.dropped, dropped - basis.T2.transpose() * beta, size,
                                rounding_unit * free_rows.norm());

  s_ = basis.Q.transpose() * free_rows + beta;
  // V' by rows of Q; rounding in the row of a contact would couple what is separate
  std::vector<Index> place(static_cast<std::size_t>(a->rows()), -1);
  for (std::size_t k = 0; k < basis.rows.size(); ++k) {
    place[static_cast<std::size_t>(basis.rows[k])] = static_cast<Index>(k);
  }
  const SparseColumns h = *mass.half(to_eigen(bodies.H));
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (Eigen::Index col = 0; col < h.cols(); ++col) {
    Vector row = Vector::Zero(rank);
    double squared = 0;
    for (SparseColumns::InnerIterator at(h, col); at; ++at) {
      squared += at.value() * at.value();
      const Index k = place[static_cast<std::size_t>(at.row())];
      if (k >= 0) row += at.value() * basis.Q.row(k).transpose();
    }
    const double rounding = 4 * std::numeric_limits<double>::epsilon() * std::sqrt(squared);
    for (Eigen::Index k = 0; k < rank; ++k) {
      if (std::abs(row[k]) > rounding) {
        entries.emplace_back(static_cast<Index>(col), static_cast<Index>(k), row[k]);
      }
    }
  }
  v_ = SparseColumns(h.cols(), rank);
  v_.setFromTriplets(entries.begin(), entries.end());

  all_ = false;
  bilateral_.reset();
  kept_ = basis.columns.kept;
  turn_ = basis.T1;
  scale_ = selected(basis.scale, kept_);
  const Eigen::MatrixXd combined = -triangle.solve(basis.T2);
  idle_ = Eigen::MatrixXd::Zero(a->cols(), basis.T2.cols());
  for (Eigen::Index k = 0; k < idle_.cols(); ++k) {
    const double unit = 1 / basis.scale[basis.columns.dropped[static_cast<std::size_t>(k)]];
    idle_(basis.columns.dropped[static_cast<std::size_t>(k)], k) = 1;
    for (Eigen::Index row = 0; row < rank; ++row) {
      idle_(kept_[static_cast<std::size_t>(row)], k) = scale_[row] * combined(row, k) * unit;
    }
  }
  return true;
}

bool Elimination::leave_out_redundant(const SparseColumns& r, const Vector& size) {
  SparseColumns both(r.rows() + v_.rows(), r.cols());  // the effect of a multiplier
  both.reserve(r.nonZeros() + v_.nonZeros());
  for (Eigen::Index col = 0; col < r.cols(); ++col) {
    both.startVec(col);
    for (SparseColumns::InnerIterator at(r, col); at; ++at) {
      both.insertBack(at.row(), col) = at.value();
    }
    for (SparseColumns::InnerIterator at(v_, col); at; ++at) {
      both.insertBack(r.rows() + at.row(), col) = at.value();
    }
  }
  both.finalize();
  const ColumnChoice columns = independent_columns(both, dependent);
  if (columns.dropped.empty()) return false;
  const SparseColumns of_kept = selected(r, columns.kept);
  const SparseColumns left = transposed(selected(transposed(of_kept), columns.kept));
  bilateral_.emplace(left, "R", false);
  all_ = false;
  kept_ = columns.kept;
  v_ = selected(v_, kept_);
  s_ = selected(problem_.s, kept_);

  const Vector impulse = bilateral_->solve(s_);
  const SparseColumns rows = transposed(selected(transposed(of_kept), columns.dropped));
  const Vector gap = selected(problem_.s, columns.dropped) - rows * impulse;
  contradiction_ = disagreement(
      columns.dropped, gap, selected(size, columns.dropped) + rows.cwiseAbs() * impulse.cwiseAbs());

  const SparseColumns right = transposed(selected(transposed(selected(r, columns.dropped)), kept_));
  const Eigen::MatrixXd combined = bilateral_->solve(right);
  idle_ = Eigen::MatrixXd::Zero(r.cols(), right.cols());
  for (Eigen::Index k = 0; k < idle_.cols(); ++k) {
    idle_(columns.dropped[static_cast<std::size_t>(k)], k) = 1;
    for (std::size_t row = 0; row < kept_.size(); ++row) {
      idle_(kept_[row], k) = -combined(static_cast<Eigen::Index>(row), k);
    }
  }
  return true;
}

void Elimination::reduce() {
  const SparseColumns right = v_.transpose();
  const SparseColumns coupling = bilateral_ ? bilateral_->solve(right) : right;
  const SparseColumns full = to_eigen(problem_.W);
  constexpr double rounding = 16 * std::numeric_limits<double>::epsilon();
  auto [w, sizes] = difference(full, v_, coupling, rounding);
  const Vector impulse = bilateral_ ? bilateral_->solve(s_) : s_;
  plain_.q = problem_.q - v_ * impulse;

  // a diagonal entry also has the rounding of the joints' own terms: its multipliers x = R^-1 V^T
  // e_k come from an R that is rounded by eps sqrt(R_ii R_jj), which enters x^T R x
  const Vector lengths = joint_lengths();
  Vector shares = Vector::Zero(full.rows());  // sum of sqrt(R_ii) |x_i|
  for (Eigen::Index col = 0; col < coupling.outerSize(); ++col) {
    for (SparseColumns::InnerIterator entry(coupling, col); entry; ++entry) {
      shares[col] += lengths[entry.row()] * std::abs(entry.value());
    }
  }
  const Vector free = full.diagonal();
  const Vector left = w.diagonal();
  const Vector terms = sizes + shares.cwiseAbs2();
  // if the diagonal entry of a component is rounding, so are its row and its velocity: if W' is
  // semidefinite, |W'_kj|^2 <= W'_kk W'_jj, and a larger entry shows that it is not
  Eigen::Array<bool, Eigen::Dynamic, 1> held_entirely =
      left.array().abs() <= rounding * terms.array() && free.array() != 0;
  const auto is_rounding = [&](Eigen::Index k, Eigen::Index j, double value) {
    return value * value <= 2 * rounding * terms[k] * terms[j];
  };
  if (held_entirely.any()) {
    for (Eigen::Index col = 0; col < w.outerSize(); ++col) {
      for (SparseColumns::InnerIterator entry(w, col); entry; ++entry) {
        if (is_rounding(entry.row(), col, entry.value())) continue;
        held_entirely[entry.row()] = held_entirely[col] = false;
      }
    }
    w.prune([&](Eigen::Index row, Eigen::Index col, double) {
      return !held_entirely[row] && !held_entirely[col];
    });
  }
  // `impulse` is a sum of terms of s; they may be larger than it in one place
  const double pushes = lengths.dot(impulse.cwiseAbs());
  for (Eigen::Index k = 0; k < left.size(); ++k) {
    const double terms_of_q = std::abs(problem_.q[k]) + pushes * shares[k];
    if (held_entirely[k] && std::abs(plain_.q[k]) <= rounding * terms_of_q) plain_.q[k] = 0;
  }
  plain_.W = converted(Matrix::from_eigen(w), Storage::csr);
}

Vector Elimination::joint_lengths() const {
  Vector lengths = Vector::Ones(v_.cols());
  if (!bilateral_) return lengths;  // R is the identity
  const Vector diagonal = to_eigen(problem_.R).diagonal().cwiseAbs().cwiseSqrt();
  return all_ ? diagonal : selected(diagonal, kept_);
}

Vector Elimination::multipliers(const Vector& velocity) const {
  Vector left = bilateral_ ? Vector(-bilateral_->solve(velocity)) : Vector(-velocity);
  if (all_) return left;
  if (turn_.size() > 0) {
    left = scale_.cwiseProduct(turn_.triangularView<Eigen::Upper>().solve(left));
  }
  Vector result = Vector::Zero(problem_.s.size());
  for (std::size_t k = 0; k < kept_.size(); ++k) {
    result[kept_[k]] = left[static_cast<Eigen::Index>(k)];
  }
  if (idle_.cols() == 0) return result;
  const Eigen::MatrixXd gram = idle_.transpose() * idle_;
  return result - idle_ * gram.llt().solve(idle_.transpose() * result);
}

Solution Elimination::expand(const Solution& plain) const {
  Solution result = plain;
  Vector velocity = s_;
  if (all_) {
    multiply_transposed_add(problem_.V, plain.r, velocity);
  } else {
    velocity += v_.transpose() * plain.r;
  }
  result.l = multipliers(velocity);
  result.u = problem_.q;
  multiply_add(problem_.W, plain.r, result.u);
  multiply_add(problem_.V, result.l, result.u);
  return result;
}

void Elimination::hold(const GlobalProblem& bodies, const Condensation& condensation,
                       Solution& solution) const {
  const auto correction = [&] {
    RealVector broken = bodies.b.cast<Real>();
    multiply_transposed_add(bodies.G, RealVector(solution.v.cast<Real>()), broken);
    Vector left = broken.cast<double>();
    if (!all_) left = selected(left, kept_);
    if (nearly_dependent()) {
      const Vector scaled = scale_.cwiseProduct(left);
      left = turn_.triangularView<Eigen::Upper>().transpose().solve(scaled);
    }
    return multipliers(left);
  };
  solution.l += correction();
  solution = condensation.expand(solution);
  Vector impulse = Vector::Zero(solution.v.size());
  multiply_add(bodies.G, correction(), impulse);
  solution.v += condensation.mass().solve(impulse);
}

LocalProblem eliminate(const LocalProblem& problem) {
  if (!is_mixed(problem)) return problem;
  const Elimination elimination(problem);
  if (elimination.contradiction()) throw *elimination.contradiction();
  return elimination.plain();
}

}  // namespace fclib
