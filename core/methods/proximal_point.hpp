// The proximal point algorithm on Coulomb's law. A semismooth Newton method solves its inner
// problem: from r_k, find p with
//
//   p = alart_curnier_projection(r_k - rho (W p + q)),   rho_a = kappa d / tr(W_aa)
//
// The turning components of a contact may have a rho of their own, from their part of W_aa: a small
// body turns far more easily than it moves, and how much more depends on the unit of length.
//
// Then project p on the cones: this is r_{k+1}. Each Newton step is one CoupledSystem with D = rho
// alart_curnier_projection'. A large kappa makes a step nearly exact, and r - r_k regularises W
// even if W is singular.
//
// The residual of the inner problem enters the error multiplied by W. So the inner problem is
// solved until that product is a fraction of the error itself. The residual does not fall below rho
// times the rounding of u. The next Newton step takes out of p again the part of it that W sees:
// the velocity of p is exact up to the rounding of p. The map of p would be in the cones without a
// projection, but its velocity is not so exact. If there are more contacts than coordinates of the
// bodies, a last velocity of 1e-12 between them may change r by a large part of itself. So kappa
// must be allowed to grow that far.
#pragma once

#include "contact/cones.hpp"
#include "function_ref.hpp"
#include "systems/coupled_system.hpp"

namespace fclib {

/// How kappa changes, and when to give up.
struct ProximalRules {
  enum class Law {
    by_steps,  ///< grows if the inner problems are easy
    by_error,  ///< 1 / (sigma error^nu), and less after failures; constant if nu is 0
  };
  Law law = Law::by_steps;
  double sigma = 1;  ///< of by_error
  double nu = 1;
  double kappa = 100;  ///< kappa at first
  double kappa_max = 1e12;
  double easy = 3;        ///< factor after 1 or 2 Newton steps; after 3 or 4, two thirds of it
  double hard = 0.5;      ///< factor after a failure
  double patience = 1e3;  ///< it is given up if the error rises above this times the best
  std::int64_t max_factorisations = 8;
  bool own_angular_rho = false;  ///< whether spin and rolling have their own rho
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

  /// Improves r. `report(error)` gets each accepted step; if it returns true, the solve ends.
  /// Returns the least error; r is the iterate that has it.
  double solve(const ProximalRules& rules, double tolerance, Vector& r,
               FunctionRef<bool(double)> report);

 private:
  static constexpr int max_steps = 20;
  static constexpr int max_halvings = 5;

  /// The argument z of the map, for contact a.
  [[nodiscard]] Vec argument(double kappa, const Vector& u, Index a) const;

  /// F = p - alart_curnier_projection(r_k - rho u(p)).
  double residual(double kappa, const Vector& p, const Vector& u, Vector& f) const;

  /// p projected on the cones. The map decides for each contact: open, sticking or sliding; the
  /// values are those of p.
  void put_into_cones(double kappa, const Vector& p, const Vector& u, Vector& result) const;

  /// d / tr(W_aa) for the components of each contact, or the same for each of its parts.
  void weigh(bool own_angular_rho);

  /// Makes one proximal step and leaves it in next_, next_u_, next_error_. Returns the number of
  /// Newton steps; 0 if it failed.
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
