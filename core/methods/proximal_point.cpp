#include "methods/proximal_point.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "contact/alart_curnier.hpp"
#include "reduced/relative_error.hpp"
#include "reduced/scale.hpp"

namespace fclib {

template <class Cone>
ProximalPoint<Cone>::ProximalPoint(const ReducedProblem& problem, CoupledSystem& system)
    : problem_(problem), system_(system) {}

template <class Cone>
void ProximalPoint<Cone>::weigh(bool own_angular_rho) {
  const Vector sizes = mean_diagonals(problem_);
  const double mean = mean_diagonal(problem_);
  constexpr int moving = Cone::lengths;
  inverse_size_.resize(problem_.m());
  for (Index a = 0; a < problem_.nc(); ++a) {
    auto inverse = inverse_size_.template segment<D>(D * a);
    inverse.setConstant(1.0 / (sizes[a] > 0 ? sizes[a] : mean));
    if (!own_angular_rho || moving == D) continue;
    const auto diagonal = problem_.W.template diagonal_block<D>(a).diagonal().eval();
    const double of_moving = diagonal.template head<moving>().mean();
    const double of_turning = diagonal.template tail<D - moving>().mean();
    if (!(of_moving > 0) || !(of_turning > 0)) continue;
    inverse.template head<moving>().setConstant(1.0 / of_moving);
    inverse.template tail<D - moving>().setConstant(1.0 / of_turning);
  }
}

template <class Cone>
double ProximalPoint<Cone>::solve(const ProximalRules& rules, double tolerance, Vector& r,
                                  FunctionRef<bool(double)> report) {
  weigh(rules.own_angular_rho);
  const auto stop_at = system_.factorisations() + rules.max_factorisations;
  double kappa = rules.kappa;
  int cautious = 0;  // steps since a failure
  r_ = r;
  problem_.velocity(r_, u_);
  error_ = relative_error<Cone>(problem_, u_, r_);
  double best = error_;
  double share = 1;  // factor on what the law says, after failures
  while (best > tolerance && system_.factorisations() < stop_at && !problem_.out_of_time()) {
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

template <class Cone>
auto ProximalPoint<Cone>::argument(double kappa, const Vector& u, Index a) const -> Vec {
  return r_.template segment<D>(D * a) - (kappa * inverse_size_.template segment<D>(D * a))
                                             .cwiseProduct(u.template segment<D>(D * a));
}

template <class Cone>
double ProximalPoint<Cone>::residual(double kappa, const Vector& p, const Vector& u,
                                     Vector& f) const {
  f.resize(p.size());
  for (Index a = 0; a < problem_.nc(); ++a) {
    f.template segment<D>(D * a) =
        p.template segment<D>(D * a) -
        alart_curnier_projection(Cone(problem_.friction, a), argument(kappa, u, a));
  }
  return f.norm();
}

template <class Cone>
void ProximalPoint<Cone>::put_into_cones(double kappa, const Vector& p, const Vector& u,
                                         Vector& result) const {
  result.resize(p.size());
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Cone cone(problem_.friction, a);
    const Vec z = argument(kappa, u, a);
    Vec inside = p.template segment<D>(D * a);
    if (!(z[0] > 0) || !(inside[0] > 0)) inside.setZero();
    for_each_group<Cone>([&](auto g) {
      constexpr int at = Cone::start(g);
      constexpr int size = Cone::size(g);
      auto part = inside.template segment<size>(at);
      const double norm = part.norm();
      const double radius = cone.coefficient(g) * inside[0];
      const bool slides = z.template segment<size>(at).norm() > cone.coefficient(g) * z[0];
      if (norm > radius || (slides && norm > 0)) part *= radius / norm;
    });
    result.template segment<D>(D * a) = inside;
  }
}

template <class Cone>
int ProximalPoint<Cone>::inner(double kappa, std::int64_t stop_at) {
  p_ = r_;
  up_ = u_;
  double norm = residual(kappa, p_, up_, f_);
  const double first = norm;
  int rises = 0;
  for (int step = 1; step <= max_steps && system_.factorisations() < stop_at; ++step) {
    std::vector<double>& blocks = system_.blocks();
    for (Index a = 0; a < problem_.nc(); ++a) {
      Eigen::Map<Mat>(blocks.data() + std::ptrdiff_t{D * D} * a) =
          alart_curnier_jacobian(Cone(problem_.friction, a), argument(kappa, up_, a)) *
          (kappa * inverse_size_.template segment<D>(D * a)).asDiagonal();
    }
    if (!system_.factorise()) return 0;
    step_ = -f_;
    system_.solve(step_);
    if (!step_.allFinite()) return 0;
    double length = 1;
    double trial_norm = 0;
    for (int halving = 0;; ++halving) {
      trial_ = p_ + length * step_;
      problem_.velocity(trial_, trial_u_, system_.workers());
      trial_norm = residual(kappa, trial_, trial_u_, f_);
      if (trial_norm < norm || halving == max_halvings) break;
      length *= 0.5;
    }
    if (!(trial_norm < 10 * norm) || (trial_norm >= norm && ++rises == 2)) return 0;
    p_ = trial_;
    up_ = trial_u_;
    norm = trial_norm;
    // or as small as the rounding, multiplied by rho, allows
    const double rounding = 10 * std::numeric_limits<double>::epsilon() * kappa * p_.norm();
    if (norm > std::max(1e-2 * first, rounding)) continue;
    put_into_cones(kappa, p_, up_, next_);
    problem_.velocity(next_, next_u_, system_.workers());
    next_error_ = relative_error<Cone>(problem_, next_u_, next_);
    const double gap = (next_u_ - up_).norm() / problem_.scale;
    if (gap <= 0.1 * next_error_ || gap <= 1e-15 || norm <= 1e-15 * p_.norm()) return step;
  }
  return 0;
}

#define FCLIB_INSTANTIATE(Cone) template class ProximalPoint<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
