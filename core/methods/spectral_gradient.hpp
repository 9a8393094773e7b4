// Spectral projected gradients on the cone relaxation, de Saxce's shift iterated.
//
//   g = W r + q + s,  s = mu ||(W r + q)_T||        (0 without the shift)
//   d = P_K(r - alpha g / weight) - r
//   r <- r + lambda d,  lambda by a nonmonotone line search (Grippo, Lampariello, Lucidi)
//   alpha = <dr, dr> / <dr, W dr> and <dr, W dr> / <W dr, W dr>, in turn
//
// Birgin, Martinez, Raydan, "Nonmonotone spectral projected gradient methods on convex sets"
// (2000); Barzilai & Borwein, "Two-point step size gradient methods" (1988). solvers/bb.cpp lists
// the differences.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "contact/cones.hpp"
#include "function_ref.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

enum class SpectralStep { longest, shortest, alternating };
inline constexpr std::array<std::string_view, 3> spectral_steps{"long", "short", "alternating"};

struct SpectralRules {
  bool shifted = true;  ///< whether the shift follows the iterates
  SpectralStep step = SpectralStep::alternating;
  std::int64_t memory = 10;  ///< the objective may rise to the largest of so many iterations
  double decrease = 1e-4;    ///< share of the predicted decrease that a step must reach
  bool weights = true;       ///< each contact has a metric from its block of W
};

/// Starts from r, with u = W r + q. After each iteration r and u are the new iterate. `stop` is
/// called with the shift (nc) that the iterate was made with. If it returns true, the method ends.
template <class Cone>
void spectral_gradient(const ReducedProblem& problem, const SpectralRules& rules, Vector& r,
                       Vector& u, FunctionRef<bool(const Vector&)> stop);

#define FCLIB_DECLARE(Cone)                                                                 \
  extern template void spectral_gradient<Cone>(const ReducedProblem&, const SpectralRules&, \
                                               Vector&, Vector&,                            \
                                               FunctionRef<bool(const Vector&)>);
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
