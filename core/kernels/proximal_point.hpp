// The proximal point algorithm on Coulomb's law, its inner problem solved by a semismooth Newton
// method: from r_k, find p with
//
//   p = disk_map(r_k - rho (W p + q)),   rho_a = kappa d / tr(W_aa)
//
// and put it into the cones: r_{k+1}. Each Newton step is one CoupledSystem with D = rho disk_map'.
// A large kappa makes a step nearly exact, and W, singular as it may be, is regularised by r - r_k
// all the same.
//
// The residual of the inner problem enters the error multiplied by W: it is solved until that is a
// fraction of the error itself. The residual does not fall below rho times the rounding of u. What
// of it W sees, the next Newton step takes out of p again: p has a velocity as exact as its
// rounding, and the map of p, which would be in the cones as it is, has not. Where contacts are
// more than the bodies' coordinates, a last velocity of 1e-12 between them may move r by a good
// part of itself: kappa must be let grow that far.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/coupled_system.hpp"
#include "kernels/disk_map.hpp"
#include "kernels/natural_error.hpp"

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
};

template <class Cone>
class ProximalPoint {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;
  using Mat = ContactMatrix<D>;

  ProximalPoint(const Delassus& problem, CoupledSystem& system)
      : problem_(problem), system_(system), inverse_size_(problem.nc()) {
    double mean = 0;
    for (Index a = 0; a < problem.nc(); ++a) {
      inverse_size_[a] = problem.W.template diagonal_block<D>(a).trace() / D;
      mean += inverse_size_[a] / static_cast<double>(problem.nc());
    }
    for (auto& size : inverse_size_) size = 1.0 / (size > 0 ? size : mean > 0 ? mean : 1.0);
  }

  /// The last accepted step.
  [[nodiscard]] const Vector& iterate() const { return r_; }

  /// Improves r. `report(error)` is told of each accepted step, and ends it by returning true.
  /// Returns the least error; r is the iterate that has it.
  template <class Report>
  double solve(const ProximalRules& rules, double tolerance, Vector& r, const Report& report) {
    const auto stop_at = system_.factorisations() + rules.max_factorisations;
    double kappa = rules.kappa;
    int cautious = 0;  // steps since a failure
    r_ = r;
    problem_.velocity(r_, u_);
    error_ = error_of(u_, r_);
    double best = error_;
    double share = 1;  // of what the law says, after failures
    while (best > tolerance && system_.factorisations() < stop_at) {
      if (rules.law == ProximalRules::Law::by_error) {
        kappa = std::min(share / (rules.sigma * std::pow(error_, rules.nu)), rules.kappa_max);
      }
      const int steps = inner(kappa, stop_at);
      if (steps == 0) {  // failed
        kappa *= rules.hard;
        share *= rules.hard;
        cautious = 3;
        if (kappa < 1e-6) break;
        continue;
      }
      r_ = next_;
      u_ = next_u_;
      error_ = next_error_;
      if (error_ < best) {
        best = error_;
        r = r_;
      }
      if (report(error_) || error_ > rules.patience * best) break;
      double growth = steps <= 2 ? rules.easy : steps <= 4 ? rules.easy * 2 / 3 : 1.0;
      if (steps >= 9) growth = 0.5;
      if (cautious > 0) {
        growth = std::min(growth, 1.5);
        --cautious;
      }
      share = std::min(1.0, share * growth);
      kappa = std::min(kappa * growth, rules.kappa_max);
    }
    return best;
  }

 private:
  static constexpr int max_steps = 20;
  static constexpr int max_halvings = 5;

  double error_of(const Vector& u, const Vector& r) const {
    return std::sqrt(natural_map_squared<Cone>(u, r, problem_.friction)) / problem_.scale;
  }

  /// The argument z of the map, of contact a.
  [[nodiscard]] Vec argument(double kappa, const Vector& u, Index a) const {
    return r_.template segment<D>(D * a) - kappa * inverse_size_[a] * u.template segment<D>(D * a);
  }

  /// F = p - disk_map(r_k - rho u(p)).
  double residual(double kappa, const Vector& p, const Vector& u, Vector& f) const {
    f.resize(p.size());
    for (Index a = 0; a < problem_.nc(); ++a) {
      f.template segment<D>(D * a) = p.template segment<D>(D * a) -
                                     disk_map(Cone(problem_.friction, a), argument(kappa, u, a));
    }
    return f.norm();
  }

  /// p in the cones: open, sticking or sliding as the map has each contact, but with p's own
  /// values.
  void put_into_cones(double kappa, const Vector& p, const Vector& u, Vector& result) const {
    result.resize(p.size());
    for (Index a = 0; a < problem_.nc(); ++a) {
      const Cone cone(problem_.friction, a);
      const Vec z = argument(kappa, u, a);
      Vec inside = p.template segment<D>(D * a);
      if (!(z[0] > 0) || !(inside[0] > 0)) inside.setZero();
      for (int g = 0; g < Cone::groups; ++g) {
        const int at = 1 + g * Cone::group_size;
        auto part = inside.template segment<Cone::group_size>(at);
        const double norm = part.norm();
        const double radius = cone.coefficient(g) * inside[0];
        const bool slides =
            z.template segment<Cone::group_size>(at).norm() > cone.coefficient(g) * z[0];
        if (norm > radius || (slides && norm > 0)) part *= radius / norm;
      }
      result.template segment<D>(D * a) = inside;
    }
  }

  /// One proximal step; leaves it in next_, next_u_, next_error_. Newton steps taken, 0 on failure.
  int inner(double kappa, std::int64_t stop_at) {
    p_ = r_;
    up_ = u_;
    double norm = residual(kappa, p_, up_, f_);
    const double first = norm;
    int rises = 0;
    for (int step = 1; step <= max_steps && system_.factorisations() < stop_at; ++step) {
      std::vector<double>& blocks = system_.blocks();
      for (Index a = 0; a < problem_.nc(); ++a) {
        Eigen::Map<Mat>(blocks.data() + std::ptrdiff_t{D * D} * a) =
            kappa * inverse_size_[a] *
            disk_map_slope(Cone(problem_.friction, a), argument(kappa, up_, a));
      }
      if (!system_.factorise()) return 0;
      step_ = -f_;
      system_.solve(step_);
      if (!step_.allFinite()) return 0;
      double length = 1;
      double trial_norm = 0;
      for (int halving = 0;; ++halving) {
        trial_ = p_ + length * step_;
        problem_.velocity(trial_, trial_u_);
        trial_norm = residual(kappa, trial_, trial_u_, f_);
        if (trial_norm < norm || halving == max_halvings) break;
        length *= 0.5;
      }
      if (!(trial_norm < 10 * norm) || (trial_norm >= norm && ++rises == 2)) return 0;
      p_ = trial_;
      up_ = trial_u_;
      norm = trial_norm;
      // or as small as rounding, which rho multiplies, lets it be
      const double rounding = 10 * std::numeric_limits<double>::epsilon() * kappa * p_.norm();
      if (norm > std::max(1e-2 * first, rounding)) continue;
      put_into_cones(kappa, p_, up_, next_);
      problem_.velocity(next_, next_u_);
      next_error_ = error_of(next_u_, next_);
      const double gap = (next_u_ - up_).norm() / problem_.scale;
      if (gap <= 0.1 * next_error_ || gap <= 1e-15 || norm <= 1e-15 * p_.norm()) return step;
    }
    return 0;
  }

  const Delassus& problem_;
  CoupledSystem& system_;
  Vector inverse_size_;  // d / tr(W_aa)
  double error_ = 0;
  double next_error_ = 0;
  Vector r_, u_, p_, up_, f_, step_, trial_, trial_u_, next_, next_u_;
};

}  // namespace fclib
