// Inner solvers of the fixed-point methods: the convex problem
//
//   min 1/2 r.W r + (q + s e_N).r,   r in a product of convex sets (convex_sets.hpp)
//
// by Gauss-Seidel on the contacts, by accelerated projected gradients, or by ADMM, each from the
// iterate of the last call and with the memory of it (steps, penalty, factors).
//
// `follow(count, r, u)` is told of an iterate and its u = W r + q after `count` more iterations,
// and ends the call by returning true; `due(count)` asks whether it wants to be told now.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "kernels/accelerated_gradient.hpp"
#include "kernels/alternating_directions.hpp"
#include "kernels/convex_residual.hpp"

namespace fclib {

/// Those that start from the last iterate.
enum class ConvexMethod { gauss_seidel, projected_gradient, admm };
inline constexpr std::array<std::string_view, 3> convex_methods{"gauss_seidel",
                                                                "projected_gradient", "admm"};

template <class Set>
class ConvexProgram {
 public:
  using Cone = typename Set::Cone;
  using Vec = typename Cone::Vec;
  static constexpr int D = Cone::dim;

  explicit ConvexProgram(const Delassus& problem)
      : problem_(problem), shift_(Vector::Zero(problem.nc())) {
    contacts_.reserve(static_cast<std::size_t>(problem.nc()));
    for (Index a = 0; a < problem.nc(); ++a)
      contacts_.emplace_back(problem.W.template diagonal_block<D>(a));
  }

  /// s: added to the normal velocities (nc).
  [[nodiscard]] Vector& shift() { return shift_; }

  /// ||r - P(r - u - s)||, relative to the problem's scale: zero at the solution.
  [[nodiscard]] double residual(const Set& set, const Vector& r, const Vector& u) const {
    return convex_residual(problem_, set, shift_, r, u);
  }

  /// By a method; `steps` of Gauss-Seidel on a contact.
  template <class Due, class Follow>
  void solve(ConvexMethod method, const Set& set, int steps, double accuracy, std::int64_t limit,
             Vector& r, Vector& u, const Due& due, const Follow& follow) {
    switch (method) {
      case ConvexMethod::gauss_seidel:
        return gauss_seidel(set, steps, accuracy, limit, r, u, due, follow);
      case ConvexMethod::projected_gradient:
        return projected_gradient(set, accuracy, limit, r, u, due, follow);
      case ConvexMethod::admm:
        return admm(set, {}, accuracy, limit, r, u, due, follow);
    }
  }

  /// Sweeps over the contacts; u is kept up to date by columns of W.
  template <class Due, class Follow>
  void gauss_seidel(const Set& set, int steps, double accuracy, std::int64_t limit, Vector& r,
                    Vector& u, const Due& due, const Follow& follow) {
    std::int64_t told = 0;
    for (std::int64_t k = 1; k <= limit; ++k) {
      for (Index a = 0; a < problem_.nc(); ++a) sweep_contact(set, a, steps, r, u);
      if (k % 4 != 1 && k != limit && !due(k - told)) continue;
      if (follow(k - told, r, u) || residual(set, r, u) <= accuracy) return;
      told = k;
    }
  }

  template <class Due, class Follow>
  void projected_gradient(const Set& set, double accuracy, std::int64_t limit, Vector& r, Vector& u,
                          const Due& due, const Follow& follow) {
    if (!gradient_) gradient_.emplace(problem_, AcceleratedGradientRules{});
    gradient_->start(r, u);
    std::int64_t told = 0;
    for (std::int64_t k = 1; k <= limit; ++k) {
      gradient_->step(set, shift_);
      if (k > 4 && k % 4 != 0 && k != limit && !due(k - told)) continue;
      r = gradient_->x();
      u = gradient_->u();
      if (follow(k - told, r, u) || residual(set, r, u) <= accuracy) return;
      told = k;
    }
  }

  template <class Due, class Follow>
  void admm(const Set& set, const AlternatingDirectionsRules& rules, double accuracy,
            std::int64_t limit, Vector& r, Vector& u, const Due& due, const Follow& follow) {
    if (!admm_) admm_.emplace(problem_, rules);
    if (!admm_->start(r, u, shift_)) return;
    std::int64_t told = 0;
    for (std::int64_t k = 1; k <= limit; ++k) {
      admm_->x_update(shift_);
      admm_->z_update(set);
      admm_->w_update();
      if (!admm_->adapt()) return;
      if (k > 4 && k % 4 != 0 && k != limit && !due(k - told)) continue;
      r = admm_->z();
      problem_.velocity(r, u);
      if (follow(k - told, r, u) || residual(set, r, u) <= accuracy) return;
      told = k;
    }
  }

 private:
  void sweep_contact(const Set& set, Index a, int steps, Vector& r, Vector& u) {
    const auto& contact = contacts_[static_cast<std::size_t>(a)];
    const Vec old = r.template segment<D>(D * a);
    Vec b = u.template segment<D>(D * a) - contact.block * old;
    b[0] += shift_[a];
    Vec next = old;
    set.minimise(a, contact, b, steps, next);
    const Vec delta = next - old;
    if ((delta.array() == 0).all()) return;
    r.template segment<D>(D * a) = next;
    problem_.W.template add_column<D>(a, delta.data(), u.data());
  }

  const Delassus& problem_;
  Vector shift_;
  std::vector<ContactCurvature<Cone>> contacts_;
  std::optional<AcceleratedGradient<Cone>> gradient_;
  std::optional<AlternatingDirections<Cone>> admm_;
};

}  // namespace fclib
