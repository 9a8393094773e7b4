// Semismooth Newton on F(u, r) = 0, u = W r + q, for any function of contact_functions.hpp:
//
//   (B + A W) dr = -F,   A = dF/du, B = dF/dr,   r <- r + t dr
//
// with t = 1, or from a line search on theta = 1/2 ||F||^2 or on that of Fischer & Burmeister's
// function. In a line search, if Newton's step is no descent, or no t is found, the search goes
// along minus the gradient instead. If the error does not fall any more, sweeps of Gauss-Seidel
// from the best iterate give a new start.
//
// If there are too few coordinates for the contacts, W is singular, and so is B + A W. W + delta I
// then replaces W, and delta goes to zero with the error.
#pragma once

#include <cstdint>

#include "contact/contact_functions.hpp"
#include "function_ref.hpp"
#include "reduced/gauss_seidel.hpp"
#include "systems/coupled_system.hpp"

namespace fclib {

enum class RhoRule {
  constant,        ///< one for all contacts
  spectral,        ///< 1 / the spectral norm of W_aa
  split_spectral,  ///< 1 / W_NN, and 1 / the spectral norm of each tangential block
  adaptive,        ///< spectral, then changed until a step moves rho u^ about as much as r
};

enum class LineSearch {
  none,
  armijo,             ///< halvings, until theta falls by a share of its slope
  goldstein_price,    ///< neither too long nor too short, by bisection
  fischer_burmeister  ///< armijo on the merit of Fischer & Burmeister's function
};

struct NewtonRules {
  RhoRule rho_rule = RhoRule::spectral;
  double rho = 1;  ///< 1/[W] if constant, else a factor
  LineSearch line_search = LineSearch::none;
  double regularisation = 1;   ///< delta over the mean of tr(W_aa) / d and the error
  std::int64_t sweeps = 10;    ///< of Gauss-Seidel if Newton stands still, then twice as many
  std::int64_t patience = 20;  ///< steps in which the error must halve
};

enum class NewtonEnd { reported, stalled, not_finite };

template <class Cone>
class SemismoothNewton {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;
  using Mat = ContactMatrix<D>;

  /// Keeps a reference to the problem. Throws Error (unsuitable) if the cone has no function of
  /// this kind.
  SemismoothNewton(const ReducedProblem& problem, ContactFunctionKind kind, int threads = 1);

  [[nodiscard]] const CoupledSystem& system() const { return system_; }
  [[nodiscard]] std::int64_t factorisations() const { return system_.factorisations(); }

  /// Improves r. `report(error)` gets each iterate; if it returns true, the solve ends. r ends as
  /// the iterate with the least error.
  NewtonEnd solve(const NewtonRules& rules, Vector& r, FunctionRef<bool(double)> report);

 private:
  using Function = ContactFunction<Cone>;

  static constexpr double least_decrease = 1e-4;  // of theta, over its slope: Armijo's
  static constexpr double low_share = 0.01;       // Goldstein & Price's
  static constexpr double high_share = 0.99;
  static constexpr int max_trials = 30;
  static constexpr std::int64_t sweeps_at_once = 10;  // between reports
  static constexpr std::int64_t most_sweeps = 1000;

  void choose_rho(const NewtonRules& rules);

  /// Khobotov's rule on each contact: rho ||du^|| <= 0.9 ||dr||, and not far from it.
  void adapt_rho();

  void sweep(std::int64_t count);

  /// F at (u, r), and the blocks of the system.
  void assemble(double delta);

  /// For contact a in f: the function that is solved, or another one whose merit is searched.
  Vec rho_of(const Function& f, Index a) const;

  /// theta = 1/2 ||F||^2.
  double merit(const Function& f, const Vector& u, const Vector& r) const;

  /// The slope of theta along dr_, du_ = W dr_.
  double slope(const Function& f) const;

  /// dr_ <- minus the gradient of theta, for symmetric W, with the length that Newton's model asks
  /// for.
  void descend(const Function& f);

  /// du_ = W dr_.
  void move();

  double merit_at(const Function& f, double length);

  /// Halves t from 1. Returns 0 if no t is good enough.
  double armijo(const Function& f, double start, double slope);

  /// low_share <= (theta(t) - theta) / (t slope) <= high_share. Returns 0 if no t is found.
  double goldstein_price(const Function& f, double start, double slope);

  /// The length of the step along dr_, which may become another direction. 0 if there is none.
  double search(LineSearch rule);

  double search_by(const Function& f, LineSearch rule);

  const ReducedProblem& problem_;
  ContactFunctionKind kind_;
  Function function_;
  CoupledSystem system_;
  GaussSeidel<Cone> contacts_;
  double size_ = 1;       // the mean of tr(W_aa) / d
  Vector spectral_norm_;  // of each W_aa
  Vector base_, rho_;     // of each component
  Vector f_, r_, u_, dr_, du_, trial_r_, trial_u_, gradient_;
};

#define FCLIB_DECLARE(Cone) extern template class SemismoothNewton<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
