// A path from the unique solution of a convex problem to a solution of Coulomb's law. It is
// followed by its arclength, since it folds.
//
// With t from 1 to 0, s = 1 - t, and for each disc (mu, r_T) of a contact (of sliding, spin or
// rolling) x = mu r_N, D = x^2 - ||r_T||^2, w = D / x:
//
//   F(r, t) = W r + q - t (g(r, t) + c) = 0
//   g_N = sum mu (x - s n) / D,   g_T = -r_T / D,   n = sqrt(||r_T||^2 + e^2 w^2) - e w
//
// t g is the velocity on the central path, u^ = t x^-1 in the Lorentz cone, less the share s of de
// Saxce's term mu ||u_T||. The kink of that term is smoothed over the width e t / x, which vanishes
// with t. A contact without discs has g_N = 1 / r_N. c makes the start a solution, at t = 1. There
// F is monotone, so it has no other solution, and the path cannot come back to t = 1. Unless it
// goes to infinity, it ends at t = 0, in a solution.
//
// The tangent (z, zeta) of the path in (r, log t) and Newton's corrector across it both come from
// one CoupledSystem with D = -(t g')^-1. Lengths are measured in the metric of the barrier, the
// Hessian of -log D, in which r stays inside the cones.
//
// H. B. Keller, "Numerical solution of bifurcation and nonlinear eigenvalue problems" (1977), for
// the arclength; S. N. Chow, J. Mallet-Paret, J. A. Yorke, "Finding zeroes of maps: homotopy
// methods that are constructive with probability one" (1978), which shows why the path arrives.
//
// All is done in the units of the contacts (reduced/own_units.hpp).
#pragma once

#include <cmath>
#include <vector>

#include "contact/cones.hpp"
#include "function_ref.hpp"
#include "reduced/own_units.hpp"
#include "systems/coupled_system.hpp"

namespace fclib {

struct HomotopyRules {
  double smoothing = 0.3;  ///< e
  double stride = 0.9;     ///< longest step of a contact, in the metric of its barrier
  double accuracy = 0.02;  ///< accuracy of a point of the path, in the same metric
  double cosine = 0.6;     ///< least cosine between the tangents at two points
  double end = 1e-11;      ///< t at which the path ends
  std::int64_t max_factorisations = 4000;
};

template <class Cone>
class Homotopy {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;
  using Mat = ContactMatrix<D>;
  using Report = FunctionRef<bool(double error, const Vector& r)>;

  Homotopy(const ReducedProblem& problem, CoupledSystem& system);

  /// The results for the last iterate.
  [[nodiscard]] double t() const { return std::exp(lambda_); }
  [[nodiscard]] int folds() const { return folds_; }

  /// Follows the path. `report(error, r)` gets each point; if it returns true, the path ends.
  void solve(const HomotopyRules& rules, Report report);

 private:
  static constexpr double least_step = 1e-7;

  bool tell(Report report);

  void start();

  [[nodiscard]] bool inside(const Vector& r) const;

  /// F, dF/dlambda, and the blocks of the system at a point inside.
  void evaluate(const Vector& r, double lambda);

  /// across <- -J^-1 F, along <- -J^-1 dF/dlambda, at a point.
  bool linearise(const Vector& r, double lambda);

  /// <x, y> of contact a in the metric of the barrier at a base point.
  [[nodiscard]] double product(const Vector& base, Index a, const Vector& x, const Vector& y) const;
  /// The mean over the contacts.
  [[nodiscard]] double product(const Vector& x, const Vector& y) const;
  [[nodiscard]] double longest(const Vector& base, const Vector& x) const;

  /// The cosine between the tangent and the next one at next_, taken with falling t.
  [[nodiscard]] double cosine() const;

  /// The unit tangent from `along`, in the direction in which the path is followed.
  void orient(bool first);

  /// Newton's method across the tangent, from next_. Returns the number of corrections; 0 if it
  /// failed.
  int correct(double step);

  const ReducedProblem& problem_;
  CoupledSystem& system_;
  HomotopyRules rules_;
  OwnUnits units_;
  std::vector<Mat> inverted_;  // of each contact, (-t g')^-1
  Vector c_, r_;
  double lambda_ = 0;  // log t
  Vector residual_, derivative_;
  Vector tangent_, across_, along_;
  double tangent_lambda_ = -1;
  Vector next_;
  double next_lambda_ = 0;
  int folds_ = 0;
  bool negative_ = false;  // det B of all contacts
  int sign_ = 1;           // of det J
  int sign_at_start_ = 1;
  Vector physical_, velocity_;
};

#define FCLIB_DECLARE(Cone) extern template class Homotopy<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
