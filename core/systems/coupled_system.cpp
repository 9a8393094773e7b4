#include "systems/coupled_system.hpp"

#include <algorithm>
#include <cmath>

#include "linalg/with_dimension.hpp"

namespace fclib {

namespace {

/// The bodies are tried only where a contact touches few of their coordinates.
constexpr Eigen::Index longest_column = 64;

void sort_once(std::vector<Index>& rows) {
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
}

/// The pattern of d x d blocks whose columns have these rows, in any order, and their diagonal.
BlockPattern pattern_of(std::vector<std::vector<Index>>& columns, int d) {
  BlockPattern pattern;
  pattern.d = d;
  pattern.first.assign(1, 0);
  for (std::size_t col = 0; col < columns.size(); ++col) {
    auto& rows = columns[col];
    rows.push_back(static_cast<Index>(col));
    sort_once(rows);
    pattern.row.insert(pattern.row.end(), rows.begin(), rows.end());
    pattern.first.push_back(static_cast<std::int64_t>(pattern.row.size()));
  }
  return pattern;
}

/// Which block of the pattern is at this row of this column; there is one.
std::int64_t place_in(const BlockPattern& pattern, Index row, Index col) {
  const auto begin = pattern.row.begin() + pattern.first[col];
  const auto end = pattern.row.begin() + pattern.first[col + 1];
  return std::lower_bound(begin, end, row) - pattern.row.begin();
}

}  // namespace

CoupledSystem::CoupledSystem(const ReducedProblem& problem, Form form, int threads)
    : problem_(problem), threads_(threads) {
  const auto d = static_cast<std::size_t>(problem.d());
  D_.assign(d * d * static_cast<std::size_t>(problem.nc()), 0.0);
  zero_ = Vector::Zero(problem.m());
  row_scale_ = Vector::Ones(problem.nc());
  if (form == Form::general) {
    B_ = D_;
  } else if (problem.primal != nullptr) {
    on_bodies_ = analyse_bodies();
  }
  if (!on_bodies_ || !bodies_are_fewer(problem)) {
    Multifrontal bodies = std::move(lu_);
    analyse_contacts();
    if (on_bodies_ && bodies.flops() < lu_.flops()) {
      lu_ = std::move(bodies);
    } else {
      on_bodies_ = false;
    }
  }
  if (on_bodies_) values_.resize(fixed_.size());
}

void CoupledSystem::analyse_contacts() {
  with_dimension(problem_.d(), [&](auto D) { analyse_contacts_of<D>(); });
}

template <int D>
void CoupledSystem::analyse_contacts_of() {
  const Index nc = problem_.nc();
  const auto count = static_cast<std::size_t>(nc);
  std::vector<std::vector<Index>> columns(count);
  problem_.W.template for_each_block<D>([&](Index row, Index col, const auto&) {
    columns[col].push_back(row);
    columns[row].push_back(col);
  });
  const BlockPattern pattern = pattern_of(columns, D);
  const auto find = [&](Index row, Index col) { return place_in(pattern, row, col); };
  place_.clear();
  problem_.W.template for_each_block<D>(
      [&](Index row, Index col, const auto&) { place_.push_back(find(row, col)); });
  diagonal_.resize(count);
  for (Index a = 0; a < nc; ++a) diagonal_[a] = find(a, a);
  values_.assign(pattern.values(), 0.0);
  lu_ = Multifrontal(pattern, threads_);
}

bool CoupledSystem::analyse_bodies() {
  const SparseColumns& M = problem_.primal->M;
  const SparseColumns& H = problem_.primal->H;
  const Eigen::Index n = M.rows();
  const int d = problem_.d();
  // the coordinates that a contact touches
  std::vector<std::vector<Index>> columns(static_cast<std::size_t>(n));
  std::vector<std::vector<Index>> touched(static_cast<std::size_t>(problem_.nc()));
  for (Index a = 0; a < problem_.nc(); ++a) {
    auto& rows = touched[a];
    for (int c = 0; c < d; ++c) {
      for (SparseColumns::InnerIterator at(H, d * a + c); at; ++at)
        rows.push_back(static_cast<Index>(at.row()));
    }
    sort_once(rows);
    if (static_cast<Eigen::Index>(rows.size()) > longest_column) return false;
    for (const Index row : rows) {
      auto& column = columns[row];
      column.insert(column.end(), rows.begin(), rows.end());
    }
  }
  for (Index col = 0; col < n; ++col) {
    for (SparseColumns::InnerIterator at(M, col); at; ++at) {
      columns[col].push_back(static_cast<Index>(at.row()));
      columns[at.row()].push_back(col);
    }
  }
  const BlockPattern pattern = pattern_of(columns, 1);
  const auto find = [&](Index row, Index col) { return place_in(pattern, row, col); };
  fixed_.assign(pattern.row.size(), 0.0);
  for (Index col = 0; col < n; ++col) {
    for (SparseColumns::InnerIterator at(M, col); at; ++at) {
      fixed_[find(static_cast<Index>(at.row()), col)] += at.value();
    }
  }
  scatter_.clear();
  for (const auto& rows : touched) {
    for (const Index col : rows) {
      for (const Index row : rows) scatter_.push_back(find(row, col));
    }
  }
  lu_ = Multifrontal(pattern, threads_);
  return true;
}

template <int D>
void CoupledSystem::fill_contacts() {
  using Block = Eigen::Matrix<double, D, D>;
  std::fill(values_.begin(), values_.end(), 0.0);
  const double* blocks = D_.data();
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Eigen::Map<const Block> block(blocks + std::ptrdiff_t{D * D} * a);
    const double size = block.norm() * problem_.W.template diagonal_block<D>(a).norm();
    const double own =
        B_.empty() ? 1.0 : Eigen::Map<const Block>(B_.data() + std::ptrdiff_t{D * D} * a).norm();
    const double largest = std::max(own, size);
    row_scale_[a] = largest > 0 ? 1.0 / largest : 1.0;
  }
  const std::int64_t* place = place_.data();
  problem_.W.template for_each_block<D>([&](Index row, Index, const auto& w) {
    Eigen::Map<Block> target(values_.data() + D * D * *place++);
    target.noalias() =
        (row_scale_[row] * Eigen::Map<const Block>(blocks + std::ptrdiff_t{D * D} * row)) * w;
  });
  for (Index a = 0; a < problem_.nc(); ++a) {
    double* target = values_.data() + D * D * diagonal_[a];
    if (!B_.empty()) {
      Eigen::Map<Block>(target, D, D) +=
          row_scale_[a] * Eigen::Map<const Block>(B_.data() + std::ptrdiff_t{D * D} * a);
      continue;
    }
    for (int c = 0; c < D; ++c) target[(D + 1) * c] += row_scale_[a];
  }
}

void CoupledSystem::fill_bodies() {
  const SparseColumns& H = problem_.primal->H;
  values_ = fixed_;
  const int d = problem_.d();
  const std::int64_t* place = scatter_.data();
  Eigen::MatrixXd h;
  Eigen::MatrixXd product;
  std::vector<Index> rows;
  for (Index a = 0; a < problem_.nc(); ++a) {
    rows.clear();
    for (int c = 0; c < d; ++c) {
      for (SparseColumns::InnerIterator at(H, d * a + c); at; ++at)
        rows.push_back(static_cast<Index>(at.row()));
    }
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    h.setZero(static_cast<Eigen::Index>(rows.size()), d);
    for (int c = 0; c < d; ++c) {
      for (SparseColumns::InnerIterator at(H, d * a + c); at; ++at) {
        h(std::lower_bound(rows.begin(), rows.end(), at.row()) - rows.begin(), c) = at.value();
      }
    }
    const Eigen::Map<const Eigen::MatrixXd> block(D_.data() + std::ptrdiff_t{d} * d * a, d, d);
    product.noalias() = (h * block) * h.transpose();
    for (Eigen::Index k = 0; k < product.size(); ++k) values_[*place++] += product.data()[k];
  }
}

bool CoupledSystem::factorise() {
  if (problem_.out_of_time()) return false;
  ++factorisations_;
  if (on_bodies_) {
    fill_bodies();
  } else {
    with_dimension(problem_.d(), [&](auto D) { fill_contacts<D>(); });
  }
  return lu_.factorise(values_);
}

void CoupledSystem::apply(const std::vector<double>& blocks, const Vector& x, Vector& y) const {
  const int d = problem_.d();
  y.resize(x.size());
  with_dimension(d, [&](auto D) {
    using Block = Eigen::Matrix<double, D, D>;
    for (Index a = 0; a < problem_.nc(); ++a) {
      y.segment<D>(D * a).noalias() =
          Eigen::Map<const Block>(blocks.data() + std::ptrdiff_t{D * D} * a) * x.segment<D>(D * a);
    }
  });
}

void CoupledSystem::solve_once(Vector& x) {
  if (on_bodies_) {
    body_ = problem_.primal->H * x;
    lu_.solve(body_);
    product_ = problem_.primal->H.transpose() * body_;
    apply(D_, product_, residual_);
    x -= residual_;
    return;
  }
  const int d = problem_.d();
  for (Index a = 0; a < problem_.nc(); ++a) x.segment(d * a, d) *= row_scale_[a];
  lu_.solve(x);
}

void CoupledSystem::solve(Vector& x) {
  rhs_ = x;
  solve_once(x);
  // one step of refinement: r = h - B x - D W x
  problem_.W.multiply_add(x, zero_, product_, workers());
  apply(D_, product_, residual_);
  if (B_.empty()) {
    rhs_ -= x;
  } else {
    apply(B_, x, body_);
    rhs_ -= body_;
  }
  rhs_ -= residual_;
  if (!rhs_.allFinite()) return;
  solve_once(rhs_);
  x += rhs_;
}

}  // namespace fclib
