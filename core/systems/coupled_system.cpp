#include "systems/coupled_system.hpp"

#include <algorithm>
#include <cmath>

#include "linalg/with_dimension.hpp"

namespace fclib {

namespace {

/// The pattern of d x d blocks whose columns have these rows, in any order, and the diagonal.
BlockPattern pattern_of(std::vector<std::vector<Index>>& columns, int d) {
  BlockPattern pattern;
  pattern.d = d;
  pattern.first.assign(1, 0);
  for (std::size_t col = 0; col < columns.size(); ++col) {
    auto& rows = columns[col];
    rows.push_back(static_cast<Index>(col));
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    pattern.row.insert(pattern.row.end(), rows.begin(), rows.end());
    pattern.first.push_back(static_cast<std::int64_t>(pattern.row.size()));
  }
  return pattern;
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
  if (!on_bodies_) {
    bodies_ = {};
  } else if (workers() != nullptr) {
    bodies_.share_out(workers()->count());
  }
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
  const auto place = [&](Index row, Index col) {  // of the block that is there
    const auto end = pattern.row.begin() + pattern.first[col + 1];
    return std::lower_bound(pattern.row.begin() + pattern.first[col], end, row) -
           pattern.row.begin();
  };
  place_.clear();
  problem_.W.template for_each_block<D>(
      [&](Index row, Index col, const auto&) { place_.push_back(place(row, col)); });
  diagonal_.resize(count);
  for (Index a = 0; a < nc; ++a) diagonal_[a] = place(a, a);
  values_.assign(pattern.values(), 0.0);
  lu_ = Multifrontal(pattern, threads_);
}

bool CoupledSystem::analyse_bodies() {
  const std::optional<BlockPattern> pattern = bodies_.analyse(*problem_.primal, problem_.d());
  if (!pattern) return false;
  lu_ = Multifrontal(*pattern, threads_);
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

bool CoupledSystem::factorise() {
  if (problem_.out_of_time()) return false;
  ++factorisations_;
  if (on_bodies_) {
    bodies_.fill(D_, values_, workers());
  } else {
    with_dimension(problem_.d(), [&](auto D) { fill_contacts<D>(); });
  }
  return lu_.factorise(values_, problem_.deadline);
}

void CoupledSystem::apply(const std::vector<double>& blocks, const Vector& x, Vector& y) const {
  const int d = problem_.d();
  y.resize(x.size());
  with_dimension(d, [&](auto D) {
    using Block = Eigen::Matrix<double, D, D>;
    in_parts(workers(), problem_.nc(), [&](std::int64_t first, std::int64_t last) {
      for (auto a = first; a < last; ++a) {
        y.segment<D>(D * a).noalias() =
            Eigen::Map<const Block>(blocks.data() + D * D * a) * x.segment<D>(D * a);
      }
    });
  });
}

void CoupledSystem::solve_once(Vector& x) {
  if (on_bodies_) {
    bodies_.to_bodies(x, body_, workers());
    lu_.solve(body_);
    bodies_.subtract_from_contacts(D_, body_, x, workers());
    return;
  }
  const int d = problem_.d();
  for (Index a = 0; a < problem_.nc(); ++a) x.segment(d * a, d) *= row_scale_[a];
  lu_.solve(x);
}

void CoupledSystem::solve(Vector& x, bool refined) {
  if (!refined) {
    solve_once(x);
    return;
  }
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
