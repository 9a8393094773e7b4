#include "methods/accelerated_gradient.hpp"

#include <algorithm>
#include <cmath>

#include "reduced/convex_sets.hpp"
#include "reduced/scale.hpp"

namespace fclib {

template <class Cone>
AcceleratedGradient<Cone>::AcceleratedGradient(const ReducedProblem& problem,
                                               AcceleratedGradientRules rules, bool weighted)
    : problem_(problem), rules_(rules), weight_(contact_weights(problem)) {
  if (!weighted) weight_.setConstant(problem.nc() > 0 ? weight_.mean() : 1.0);
}

template <class Cone>
void AcceleratedGradient<Cone>::start(const Vector& x, const Vector& u) {
  x_ = y_ = x;
  u_ = uy_ = u;
  next_ = x;
  next_u_ = u;
  theta_ = 1;
}

template <class Cone>
template <class Set>
void AcceleratedGradient<Cone>::step(const Set& set, const Vector& shift) {
  for (int attempt = 0; attempt < 60; ++attempt) {
    double gradient_change = 0;
    double length = 0;
    uphill_ = 0;
    for (Index a = 0; a < problem_.nc(); ++a) {
      Vec gradient = uy_.template segment<D>(D * a);
      gradient[0] += shift[a];
      const Vec y = y_.template segment<D>(D * a);
      const Vec next = set.project(a, y - (t_ / weight_[a]) * gradient, y);
      next_.template segment<D>(D * a) = next;
      length += weight_[a] * (next - y).squaredNorm();
      uphill_ += gradient.dot(next - x_.template segment<D>(D * a));
    }
    problem_.velocity(next_, next_u_);
    gradient_change = (next_ - y_).dot(next_u_ - uy_);
    if (!(t_ * gradient_change > length)) break;
    t_ = std::clamp(0.95 * length / gradient_change, 0.1 * t_, rules_.reduction * t_);
  }
  const double grown = 0.5 * (1 + std::sqrt(1 + 4 * theta_ * theta_));
  double beta = (theta_ - 1) / grown;
  theta_ = grown;
  if (rules_.restart && uphill_ > 0) {
    theta_ = 1;
    beta = 0;
  }
  y_ = next_ + beta * (next_ - x_);
  uy_ = next_u_ + beta * (next_u_ - u_);
  x_.swap(next_);
  u_.swap(next_u_);
  t_ *= rules_.growth;
}

#define FCLIB_INSTANTIATE(Cone)                                                     \
  template class AcceleratedGradient<Cone>;                                         \
  template void AcceleratedGradient<Cone>::step(const Cones<Cone>&, const Vector&); \
  template void AcceleratedGradient<Cone>::step(const Cylinders<Cone>&, const Vector&);
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
