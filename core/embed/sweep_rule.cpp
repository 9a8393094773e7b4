#include "embed/sweep_rule.hpp"

#include <algorithm>
#include <cmath>

namespace fclib {

namespace {

/// Sweeps of projections go on as long as no more of them are foreseen than cost as much as a few
/// steps of Newton's method, within these bounds. They cost a half of exact ones or less, but more
/// of them are needed, and if contacts are redundant very many.
constexpr double least_projections = 20;
constexpr double most_projections = 250;
constexpr double few_newton_steps = 2;
/// If a sweep changes r by less than so many tolerances, the end is near.
constexpr double near_end = 100;

}  // namespace

StepCosts::StepCosts(int dim, std::size_t contacts, std::size_t blocks) {
  const auto count = static_cast<double>(contacts);
  const double products = 2.0 * dim * dim * static_cast<double>(blocks);
  exact = 200 * count + products;
  projected = 50 * count + products;
  const double n = dim * count;
  newton = 2.0 / 3.0 * n * n * n + 6 * n * n + 2 * exact;
}

SweepRule::SweepRule(const StepCosts& costs, double part)
    : step_(costs.newton / (part * costs.projected)),
      worth_(std::clamp(few_newton_steps * step_, least_projections, most_projections)) {}

bool SweepRule::goes_on(int k, double last, double change, double tolerance) const {
  if (!std::isfinite(change)) return false;
  if (k % between != 0) return true;
  const double rate = std::log(last / change);
  const bool slow = !(rate > 0) || std::log(change / tolerance) > worth_ * rate;
  // near the end a slow sweep or two say little
  return !slow || (change <= near_end * tolerance && k <= 2 * step_);
}

}  // namespace fclib
