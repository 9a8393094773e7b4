#include "methods/spectral_gradient.hpp"

#include <algorithm>
#include <vector>

#include "reduced/convex_sets.hpp"
#include "reduced/de_saxce_shift.hpp"
#include "reduced/scale.hpp"

namespace fclib {

namespace {

constexpr double least_step = 1e-6;
constexpr double greatest_step = 1e6;

/// The next alpha, from the last step: pp = <dr, dr>, pw = <dr, W dr>, ww = <W dr, W dr>.
double next_step(SpectralStep step, std::int64_t k, double pp, double pw, double ww) {
  if (!(pp > 0 && pw > 0)) return greatest_step;
  const bool short_one =
      step == SpectralStep::shortest || (step == SpectralStep::alternating && k % 2 == 0);
  return std::clamp(short_one ? pw / ww : pp / pw, least_step, greatest_step);
}

}  // namespace

template <class Cone>
void spectral_gradient(const ReducedProblem& problem, const SpectralRules& rules, Vector& r,
                       Vector& u, FunctionRef<bool(const Vector&)> stop) {
  constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;
  const Index nc = problem.nc();
  const Cones<Cone> cones(problem.friction);
  Vector weight = contact_weights(problem);
  if (!rules.weights) weight.setConstant(nc > 0 ? weight.mean() : 1.0);
  Vector shift = Vector::Zero(nc);
  Vector last_shift = shift;
  Vector d(problem.m());
  Vector wd(problem.m());
  const Vector zero = Vector::Zero(problem.m());
  std::vector<double> values(static_cast<std::size_t>(rules.memory), -1e300);
  double value = 0;  // the objective, up to a constant
  values[0] = value;
  double alpha = 1;
  for (std::int64_t k = 1;; ++k) {
    if (rules.shifted) {
      last_shift.swap(shift);
      de_saxce_shift<Cone>(u, problem.friction, shift);
      if (k == 1) last_shift = shift;
      // the earlier objective, with the new shift
      double moved = 0;
      for (Index a = 0; a < nc; ++a) moved += (shift[a] - last_shift[a]) * r[D * a];
      for (double& past : values) past += moved;
      value += moved;
    }
    double slope = 0;
    double pp = 0;
    for (Index a = 0; a < nc; ++a) {
      Vec g = u.template segment<D>(D * a);
      g[0] += shift[a];
      const Vec now = r.template segment<D>(D * a);
      const Vec step = cones.project(a, now - (alpha / weight[a]) * g, now) - now;
      d.template segment<D>(D * a) = step;
      slope += g.dot(step);
      pp += weight[a] * step.squaredNorm();
    }
    problem.W.multiply_add(d, zero, wd);
    const double pw = d.dot(wd);
    double ww = 0;
    for (Index a = 0; a < nc; ++a) ww += wd.template segment<D>(D * a).squaredNorm() / weight[a];

    // along d the objective is the parabola slope lambda + pw lambda^2 / 2
    double lambda = 1;
    const double highest = *std::max_element(values.begin(), values.end());
    if (value + slope + 0.5 * pw > highest + rules.decrease * slope && pw > 0) {
      lambda = std::clamp(-slope / pw, 1e-3, 1.0);
    }
    r += lambda * d;
    u += lambda * wd;
    value += lambda * (slope + 0.5 * lambda * pw);
    values[static_cast<std::size_t>(k % rules.memory)] = value;
    alpha = next_step(rules.step, k, pp, pw, ww);

    if (k % 100 == 0) problem.velocity(r, u);
    if (stop(shift)) return;
  }
}

#define FCLIB_INSTANTIATE(Cone)                                                               \
  template void spectral_gradient<Cone>(const ReducedProblem&, const SpectralRules&, Vector&, \
                                        Vector&, FunctionRef<bool(const Vector&)>);
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
