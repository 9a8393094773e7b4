// Inner solvers of the fixed-point methods: the convex problem
//
//   min 1/2 r.W r + (q + s e_N).r,   r in a product of convex sets (convex_sets.hpp)
//
// by Gauss-Seidel on the contacts, by accelerated projected gradients, or by ADMM. Each starts from
// the iterate of the last call and with what it remembers (steps, penalty, factors).
//
// `follow(count, r, u)` gets an iterate and its u = W r + q after `count` more iterations. If it
// returns true, the call ends. `due(count)` tells whether it wants an iterate now.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "function_ref.hpp"
#include "methods/accelerated_gradient.hpp"
#include "methods/alternating_directions.hpp"
#include "reduced/convex_sets.hpp"

namespace fclib {

/// The methods that start from the last iterate.
enum class ConvexMethod { gauss_seidel, projected_gradient, admm };
inline constexpr std::array<std::string_view, 3> convex_methods{"gauss_seidel",
                                                                "projected_gradient", "admm"};

template <class Set>
class ConvexProgram {
 public:
  using Cone = typename Set::Cone;
  using Vec = typename Cone::Vec;
  static constexpr int D = Cone::dim;
  using Due = FunctionRef<bool(std::int64_t count)>;
  using Follow = FunctionRef<bool(std::int64_t count, const Vector& r, const Vector& u)>;

  explicit ConvexProgram(const ReducedProblem& problem);

  /// Sets s, which is added to the normal velocities (nc).
  [[nodiscard]] Vector& shift() { return shift_; }

  /// ||r - P(r - u - s)||, relative to the problem's scale: zero at the solution.
  [[nodiscard]] double residual(const Set& set, const Vector& r, const Vector& u) const;

  /// Runs a method; `steps` is the number of steps of Gauss-Seidel on a contact.
  void solve(ConvexMethod method, const Set& set, int steps, double accuracy, std::int64_t limit,
             Vector& r, Vector& u, Due due, Follow follow);

  /// Sweeps over the contacts. Columns of W keep u up to date.
  void gauss_seidel(const Set& set, int steps, double accuracy, std::int64_t limit, Vector& r,
                    Vector& u, Due due, Follow follow);

  void projected_gradient(const Set& set, double accuracy, std::int64_t limit, Vector& r, Vector& u,
                          Due due, Follow follow);

  void admm(const Set& set, const AlternatingDirectionsRules& rules, double accuracy,
            std::int64_t limit, Vector& r, Vector& u, Due due, Follow follow);

 private:
  void sweep_contact(const Set& set, Index a, int steps, Vector& r, Vector& u);

  const ReducedProblem& problem_;
  Vector shift_;
  std::vector<ContactCurvature<Cone>> contacts_;
  std::optional<AcceleratedGradient<Cone>> gradient_;
  std::optional<CoupledSystem> system_;
  std::optional<AlternatingDirections<Cone>> admm_;
};

#define FCLIB_DECLARE(Cone)                         \
  extern template class ConvexProgram<Cones<Cone>>; \
  extern template class ConvexProgram<Cylinders<Cone>>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
