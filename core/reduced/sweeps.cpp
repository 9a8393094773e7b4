#include "reduced/sweeps.hpp"

#include <algorithm>
#include <numeric>

#include "linalg/cpu_time.hpp"

namespace fclib {

template <class Cone>
Sweeps<Cone>::Sweeps(const ReducedProblem& problem, std::int64_t threads, double omega) {
  if (threads > 1) {
    start_ = cpu_time();
    coloured_.emplace(problem, omega, static_cast<int>(threads));
  } else {
    contacts_.emplace(problem, omega);
    order_.resize(static_cast<std::size_t>(problem.nc()));
    std::iota(order_.begin(), order_.end(), 0);
  }
}

template <class Cone>
void Sweeps<Cone>::shuffle(std::mt19937_64& random) {
  // Fisher-Yates by hand: std::shuffle differs between standard libraries
  const auto mix = [&](auto& order) {
    for (std::size_t k = order.size(); k > 1; --k) std::swap(order[k - 1], order[random() % k]);
  };
  coloured_ ? mix(coloured_->sequence()) : mix(order_);
}

template <class Cone>
void Sweeps<Cone>::sweep(FunctionRef<void(Index)> visit) {
  if (coloured_) return coloured_->sweep(visit);
  for (const Index a : order_) visit(a);
}

template <class Cone>
auto Sweeps<Cone>::update(Index a, Vector& r, Vector& u, const LocalStep<Cone>& step) -> Vec {
  return coloured_ ? coloured_->update(a, r, step) : contacts_->update(a, r, u, step);
}

template <class Cone>
void Sweeps<Cone>::velocity(const Vector& r, Vector& u) {
  if (coloured_) coloured_->velocity(r, u);
}

template <class Cone>
std::optional<double> Sweeps<Cone>::cpu_s() const {
  if (!coloured_) return std::nullopt;
  return cpu_time() - start_ + coloured_->cpu_s();
}

#define FCLIB_INSTANTIATE(Cone) template class Sweeps<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
