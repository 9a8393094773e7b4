#include "reduced/coloured_sweeps.hpp"

#include <algorithm>
#include <numeric>

namespace fclib {

template <class Cone>
ColouredSweeps<Cone>::ColouredSweeps(const ReducedProblem& problem, double omega, int threads)
    : problem_(problem),
      colouring_(colour_contacts(problem.W)),
      workers_(std::min(threads, most_clusters())) {
  contacts_.reserve(colouring_.order.size());
  for (const Index a : colouring_.order) {
    contacts_.emplace_back(problem.W.template diagonal_block<D>(a) / omega,
                           Cone(problem.friction, a));
  }
  copy_rows();
  share_out();
  sequence_.resize(colours());
  std::iota(sequence_.begin(), sequence_.end(), std::size_t{0});
}

template <class Cone>
void ColouredSweeps<Cone>::reverse() {
  std::reverse(sequence_.begin(), sequence_.end());
  backwards_ = !backwards_;
}

template <class Cone>
void ColouredSweeps<Cone>::sweep(FunctionRef<void(Index)> visit) {
  workers_.run([&](int k) {
    for (const std::size_t colour : sequence_) {
      const auto [begin, end] = share(colour, k);
      for (std::size_t at = begin; at < end; ++at) {
        visit(colouring_.order[backwards_ ? begin + (end - 1 - at) : at]);
      }
      workers_.wait();
    }
  });
}

template <class Cone>
auto ColouredSweeps<Cone>::update(Index a, Vector& r, const LocalStep<Cone>& step) -> Vec {
  const std::size_t at = position_[static_cast<std::size_t>(a)];
  Contact& contact = contacts_[at];
  const Vec old = r.template segment<D>(D * a);
  const Vec b = velocity_at(at, r) - contact.projected.block() * old;
  Vec next = old;
  step(contact, b, next);
  r.template segment<D>(D * a) = next;
  return next - old;
}

template <class Cone>
void ColouredSweeps<Cone>::velocity(const Vector& r, Vector& u) {
  workers_.run([&](int k) {
    for (std::size_t colour = 0; colour < colours(); ++colour) {
      const auto [begin, end] = share(colour, k);
      for (std::size_t at = begin; at < end; ++at) {
        const Index a = colouring_.order[at];
        u.template segment<D>(D * a) = velocity_at(at, r);
      }
    }
  });
}

template <class Cone>
auto ColouredSweeps<Cone>::velocity_at(std::size_t at, const Vector& r) const -> Vec {
  // one sum for each entry of a block: the additions need not wait for each other
  double sums[D * D] = {};
  const double* block = values_.data() + std::size_t{D * D} * row_[at];
  for (std::size_t k = row_[at]; k < row_[at + 1]; ++k, block += D * D) {
    const double* x = r.data() + std::ptrdiff_t{D} * column_[k];
    for (int c = 0; c < D; ++c) {
      for (int i = 0; i < D; ++i) sums[D * c + i] += block[D * c + i] * x[c];
    }
  }
  Vec u = problem_.q.template segment<D>(D * colouring_.order[at]);
  for (int c = 0; c < D; ++c) u += Eigen::Map<const Vec>(sums + D * c);
  return u;
}

template <class Cone>
int ColouredSweeps<Cone>::most_clusters() const {
  std::size_t most = 1;
  for (std::size_t c = 0; c < colours(); ++c) {
    most = std::max(most, colouring_.colours[c + 1] - colouring_.colours[c]);
  }
  return static_cast<int>(most);
}

template <class Cone>
void ColouredSweeps<Cone>::copy_rows() {
  const auto nc = colouring_.order.size();
  position_.resize(nc);
  for (std::size_t at = 0; at < nc; ++at) {
    position_[static_cast<std::size_t>(colouring_.order[at])] = at;
  }
  row_.assign(nc + 1, 0);
  problem_.W.template for_each_block<D>(
      [&](Index row, Index, const auto&) { ++row_[position_[static_cast<std::size_t>(row)] + 1]; });
  std::partial_sum(row_.begin(), row_.end(), row_.begin());
  column_.resize(row_.back());
  values_.resize(std::size_t{D * D} * row_.back());
  std::vector<std::size_t> next(row_.begin(), row_.end() - 1);
  problem_.W.template for_each_block<D>([&](Index row, Index col, const auto& block) {
    const std::size_t k = next[position_[static_cast<std::size_t>(row)]]++;
    column_[k] = col;
    Eigen::Map<ContactMatrix<D>>(values_.data() + std::size_t{D * D} * k) = block;
  });
}

template <class Cone>
void ColouredSweeps<Cone>::share_out() {
  const auto count = static_cast<std::size_t>(workers_.count());
  for (std::size_t c = 0; c < colours(); ++c) {
    const auto* first = colouring_.clusters.data() + colouring_.colours[c];
    const auto* last = colouring_.clusters.data() + colouring_.colours[c + 1];
    const std::size_t start = row_[*first];
    const std::size_t blocks = row_[*last] - start;
    for (std::size_t k = 0; k <= count; ++k) {
      shares_.push_back(*std::lower_bound(
          first, last, start + blocks * k / count,
          [&](std::size_t cluster, std::size_t block) { return row_[cluster] < block; }));
    }
  }
}

template <class Cone>
std::pair<std::size_t, std::size_t> ColouredSweeps<Cone>::share(std::size_t colour, int k) const {
  const std::size_t at = colour * static_cast<std::size_t>(workers_.count() + 1);
  const auto own = at + static_cast<std::size_t>(k);
  return {shares_[own], shares_[own + 1]};
}

#define FCLIB_INSTANTIATE(Cone) template class ColouredSweeps<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
