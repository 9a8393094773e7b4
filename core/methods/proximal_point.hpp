// The proximal point algorithm on Coulomb's law, its inner problem solved by a semismooth Newton
// method: from r_k, find p with
//
//   p = alart_curnier_projection(r_k - rho (W p + q)),   rho_a = kappa d / tr(W_aa)
//
// The rolling components of a contact may have a rho of their own, from their part of W_aa: a small
// body turns far more easily than it moves, in numbers that depend on the unit of length.
//
// and put it into the cones: r_{k+1}. Each Newton step is one CoupledSystem with D = rho
// alart_curnier_projection'. A large kappa makes a step nearly exact, and W, singular as it may be,
// is regularised by r - r_k all the same.
//
// The residual of the inner problem enters the error multiplied by W: it is solved until that is a
// fraction of the error itself. The residual does not fall below rho times the rounding of u. What
// of it W sees, the next Newton step takes out of p again: p has a velocity as exact as its
// rounding, and the map of p, which would be in the cones as it is, has not. Where contacts are
// more than the bodies' coordinates, a last velocity of 1e-12 between them may move r by a good
// part of itself: kappa must be let grow that far.
#pragma once

#include "contact/cones.hpp"
#include "function_ref.hpp"
#include "systems/coupled_system.hpp"

namespace fclib {

/// How kappa moves, and when to give up.
struct ProximalRules {
  enum class Law {
    by_steps,  ///< grows as the inner problems are easy
    by_error,  ///< 1 / (sigma error^nu), and less after failures; constant where nu is 0
  };
  Law law = Law::by_steps;
  double sigma = 1;  ///< of by_error
  double nu = 1;
  double kappa = 100;  ///< at first
  double kappa_max = 1e12;
  double easy = 3;        ///< factor after at most 2 Newton steps; after at most 4, its share 2/3
  double hard = 0.5;      ///< factor on failure
  double patience = 1e3;  ///< the error may rise by this over the best before it is given up
  std::int64_t max_factorisations = 8;
  bool own_rolling_rho = false;  ///< whether rolling components have their own rho
};

template <class Cone>
class ProximalPoint {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;
  using Mat = ContactMatrix<D>;

  ProximalPoint(const ReducedProblem& problem, CoupledSystem& system);

  /// The last accepted step.
  [[nodiscard]] const Vector& iterate() const { return r_; }

  /// Improves r. `report(error)` is told of each accepted step, and ends it by returning true.
  /// Returns the least error; r is the iterate that has it.
  double solve(const ProximalRules& rules, double tolerance, Vector& r,
               FunctionRef<bool(double)> report);

 private:
  static constexpr int max_steps = 20;
  static constexpr int max_halvings = 5;

  /// The argument z of the map, of contact a.
  [[nodiscard]] Vec argument(double kappa, const Vector& u, Index a) const;

  /// F = p - alart_curnier_projection(r_k - rho u(p)).
  double residual(double kappa, const Vector& p, const Vector& u, Vector& f) const;

  /// p in the cones: open, sticking or sliding as the map has each contact, but with p's own
  /// values.
  void put_into_cones(double kappa, const Vector& p, const Vector& u, Vector& result) const;

  /// d / tr(W_aa) at the components of each contact, or that of its parts.
  void weigh(bool own_rolling_rho);

  /// One proximal step; leaves it in next_, next_u_, next_error_. Newton steps taken, 0 on failure.
  int inner(double kappa, std::int64_t stop_at);

  const ReducedProblem& problem_;
  CoupledSystem& system_;
  Vector inverse_size_;  // of each component (m)
  double error_ = 0;
  double next_error_ = 0;
  Vector r_, u_, p_, up_, f_, step_, trial_, trial_u_, next_, next_u_;
};

#define FCLIB_DECLARE(Cone) extern template class ProximalPoint<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
