// An interior-point method for Coulomb's law, with de Saxce's term inside the Newton system.
//
//   x = (mu r_N, r_T),  y = (u^_N / mu, u^_T),  both in the Lorentz cone,  x o y = tau e
//   R = u + mu ||y_T|| e_N - u^ = 0,  u = W r + q
//
// Nesterov & Todd's scaling N (N^2 y = x, lambda = N y) turns Newton's step into one CoupledSystem:
// with S = diag(1/mu, 1, 1), P = I + mu e_N (y_T / ||y_T||)^T, D0 = S N^2 S P, and delta > 0,
//
//   (I + D W) dr = (I + delta D0)^-1 (S N g - D0 R),   D = (I + delta D0)^-1 D0
//
// Mehrotra's predictor and corrector choose g. Without the term (`associated`) this is the convex
// problem of an associated flow rule. If a packing is jammed, the velocities go to zero along the
// path and have the size of tau. Then the kink of the term makes the path fold. `smoothing`
// replaces ||y_T|| by sqrt(||y_T||^2 + w^2) - w with w = smoothing tau: velocities of that size
// follow the associated rule.
//
// Acary, Armand, Nguyen, Shpakovych, "Second order cone programming for frictional contact
// mechanics using interior point algorithm" (2023), for the convex part. The shift in the Newton
// system is added here.
//
// All is done in the units of the contacts (reduced/own_units.hpp), so that the start and delta
// suit light bodies beside heavy ones.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <vector>

#include "contact/coulomb.hpp"
#include "contact/lorentz.hpp"
#include "function_ref.hpp"
#include "methods/interior_rules.hpp"
#include "reduced/own_units.hpp"
#include "systems/coupled_system.hpp"

namespace fclib {

template <int D>
class InteriorPoint {
 public:
  using Cone = Coulomb<D>;
  using Vec = ContactVector<D>;
  using Mat = ContactMatrix<D>;
  static constexpr int T = D - 1;

  InteriorPoint(const ReducedProblem& problem, CoupledSystem& system);

  [[nodiscard]] double tau() const { return tau_; }
  /// ||R||_inf / ||q||_inf and ||u|| / ||q|| of the last iterate.
  [[nodiscard]] double residual() const { return residual_; }
  [[nodiscard]] double speed() const { return velocity_.norm() / problem_.q.norm(); }
  [[nodiscard]] int iterations() const { return iterations_; }

  /// Iterates from near a guess. `report(error, r)` gets each iterate; if it returns true, the
  /// solve ends.
  void solve(const InteriorPointRules& rules, const Vector& guess,
             FunctionRef<bool(double error, const Vector& r)> report);

  // ---- what follow_path (methods/interior_path.hpp) calls

  void evaluate(const InteriorPointRules& rules);
  bool assemble(double delta, const InteriorPointRules& rules);
  void predict() { g_ = -lambda_; }
  void keep_predictor();
  /// lambda \ g for the corrector: g <- -lambda + lambda \ (sigma tau e - second order).
  void correct(double sigma, bool second_order);
  /// The shift mu ||y_T|| is convex. What its linearisation misses over the predictor's step is
  /// added to R.
  void correct_shift(double step);
  bool direction(double delta);
  [[nodiscard]] double longest() const;
  [[nodiscard]] double gap(double step) const;
  void advance(double step);

 private:
  /// The start: x - y as the guess has it, and x o y = tau e. It is centred. The smaller tau is,
  /// the nearer it is to the guess.
  void start(const InteriorPointRules& rules, const Vector& guess);

  /// ||y_T||, smoothed at its kink.
  [[nodiscard]] double sliding(double norm) const { return std::hypot(norm, width_) - width_; }

  /// Calls f(a) for each contact, on all threads. f writes only what belongs to contact a.
  template <class F>
  void each(const F& f) const {
    in_parts(system_.workers(), problem_.nc(), [&](std::int64_t first, std::int64_t last) {
      for (auto a = first; a < last; ++a) f(static_cast<Index>(a));
    });
  }

  /// The largest f(a) of all contacts.
  template <class F>
  [[nodiscard]] double largest(const F& f) const {
    double result = -std::numeric_limits<double>::infinity();
    std::mutex one_at_a_time;
    in_parts(system_.workers(), problem_.nc(), [&](std::int64_t first, std::int64_t last) {
      double own = -std::numeric_limits<double>::infinity();
      for (auto a = first; a < last; ++a) own = std::max(own, f(static_cast<Index>(a)));
      const std::lock_guard lock(one_at_a_time);
      result = std::max(result, own);
    });
    return result;
  }

  /// S N g of a contact.
  [[nodiscard]] Vec scaled_target(Index a) const;

  struct Scaling {
    lorentz::Scaling<D> cone;
    Mat P, D0, regular;
  };

  const ReducedProblem& problem_;
  CoupledSystem& system_;
  OwnUnits units_;
  double tau_ = 1;
  double width_ = 0;  // of the smoothing
  double residual_ = 0;
  int iterations_ = 0;
  std::vector<Scaling> scaling_;
  Vector x_, y_, r_, u_, g_, lambda_, dx_, dy_, dr_, rhs_, residual_vector_;
  Vector affine_x_, affine_y_, physical_, velocity_;
};

extern template class InteriorPoint<2>;
extern template class InteriorPoint<3>;
extern template class InteriorPoint<4>;

}  // namespace fclib
