#include "methods/semismooth_newton.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "linalg/symmetric_eigen.hpp"
#include "reduced/relative_error.hpp"
#include "reduced/scale.hpp"

namespace fclib {

template <class Cone>
SemismoothNewton<Cone>::SemismoothNewton(const ReducedProblem& problem, ContactFunctionKind kind,
                                         int threads)
    : problem_(problem),
      kind_(kind),
      function_(contact_function<Cone>(kind)),
      system_(problem, CoupledSystem::Form::general, threads),
      contacts_(problem) {
  const auto m = problem.m();
  for (Vector* v : {&f_, &r_, &u_, &dr_, &du_, &trial_r_, &trial_u_, &gradient_, &rho_, &base_})
    v->setZero(m);
  spectral_norm_.resize(problem.nc());
}

template <class Cone>
NewtonEnd SemismoothNewton<Cone>::solve(const NewtonRules& rules, Vector& r,
                                        FunctionRef<bool(double)> report) {
  choose_rho(rules);
  r_ = r;
  problem_.velocity(r_, u_);
  double error = relative_error<Cone>(problem_, u_, r_);
  double best = error;
  double mark = error;  // the error must halve from here
  double at_restart = error;
  std::int64_t since = 0;
  const auto accept = [&] {
    error = relative_error<Cone>(problem_, u_, r_);
    if (error < best) {
      best = error;
      r = r_;
    }
    ++since;
    if (error < 0.5 * mark) {
      mark = error;
      since = 0;
    }
    return report(error);
  };
  std::int64_t sweeps = rules.sweeps;
  for (;;) {
    const double delta = rules.regularisation * size_ * std::min(error, 1.0);
    assemble(delta);
    if (!system_.factorise()) {
      return problem_.out_of_time() ? NewtonEnd::stalled : NewtonEnd::not_finite;
    }
    dr_ = -f_;
    system_.solve(dr_);
    const double length = search(rules.line_search);
    if (length > 0) {
      trial_r_ = r_ + length * dr_;
      problem_.velocity(trial_r_, trial_u_);
      if (rules.rho_rule == RhoRule::adaptive) adapt_rho();
      r_.swap(trial_r_);
      u_.swap(trial_u_);
    }
    if (!(length > 0) || since >= rules.patience || !u_.allFinite()) {
      if (sweeps == 0) return u_.allFinite() ? NewtonEnd::stalled : NewtonEnd::not_finite;
      if (sweeps == most_sweeps && !(best < 0.5 * at_restart)) return NewtonEnd::stalled;
      at_restart = best;
      r_ = r;
      problem_.velocity(r_, u_);
      for (std::int64_t left = sweeps; left > sweeps_at_once; left -= sweeps_at_once) {
        sweep(sweeps_at_once);
        if (accept()) return NewtonEnd::reported;
      }
      sweep((sweeps - 1) % sweeps_at_once + 1);
      sweeps = std::min<std::int64_t>(2 * sweeps, most_sweeps);
      mark = best;
      since = 0;
    }
    if (accept()) return NewtonEnd::reported;
  }
}

template <class Cone>
void SemismoothNewton<Cone>::choose_rho(const NewtonRules& rules) {
  size_ = mean_diagonal(problem_);
  const auto inverse = [&](double x) { return 1 / (x > 1e-12 * size_ ? x : size_); };
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Mat w = problem_.W.template diagonal_block<D>(a);
    auto rho = base_.template segment<D>(D * a);
    spectral_norm_[a] = spectral_norm(w);
    rho.setConstant(inverse(spectral_norm_[a]));
    if (rules.rho_rule == RhoRule::constant) rho.setOnes();
    if (function_.split && rules.rho_rule == RhoRule::split_spectral) {
      rho[0] = inverse(w(0, 0));
      for_each_group<Cone>([&](auto g) {
        constexpr int at = Cone::start(g);
        constexpr int S = Cone::size(g);
        const double norm = spectral_norm(w.template block<S, S>(at, at));
        rho.template segment<S>(at).setConstant(inverse(norm));
      });
    }
    rho *= rules.rho;
  }
  rho_ = base_;
}

template <class Cone>
void SemismoothNewton<Cone>::adapt_rho() {
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Cone cone(problem_.friction, a);
    const double dr = (trial_r_.template segment<D>(D * a) - r_.template segment<D>(D * a)).norm();
    if (!(dr > 0)) continue;
    const double du = (cone.modified(trial_u_.template segment<D>(D * a)) -
                       cone.modified(u_.template segment<D>(D * a)))
                          .norm();
    auto rho = rho_.template segment<D>(D * a);
    const double ratio = rho[0] * du / dr;
    const double base = base_[D * a];
    if (ratio > 0.9 && rho[0] > 1e-3 * base) rho *= 2.0 / 3;
    if (ratio < 0.3 && rho[0] < 1e3 * base) rho *= 1.5;
  }
}

template <class Cone>
void SemismoothNewton<Cone>::sweep(std::int64_t count) {
  for (std::int64_t k = 0; k < count; ++k) contacts_.sweep(r_, u_);
  problem_.velocity(r_, u_);
}

template <class Cone>
void SemismoothNewton<Cone>::assemble(double delta) {
  double* a_blocks = system_.blocks().data();
  double* b_blocks = system_.own_blocks().data();
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Cone cone(problem_.friction, a);
    const Vec rho = rho_.template segment<D>(D * a);
    const Vec u = u_.template segment<D>(D * a);
    const Vec r = r_.template segment<D>(D * a);
    Mat A;
    Mat B;
    f_.template segment<D>(D * a) = function_.value(cone, rho, u, r);
    function_.jacobian(cone, rho, u, r, A, B);
    B += delta * A;
    Eigen::Map<Mat>(a_blocks + std::ptrdiff_t{D * D} * a) = A;
    Eigen::Map<Mat>(b_blocks + std::ptrdiff_t{D * D} * a) = B;
  }
}

template <class Cone>
auto SemismoothNewton<Cone>::rho_of(const Function& f, Index a) const -> Vec {
  if (&f == &function_) return rho_.template segment<D>(D * a);
  return Vec::Constant(spectral_norm_[a] > 1e-12 * size_ ? 1 / spectral_norm_[a] : 1 / size_);
}

template <class Cone>
double SemismoothNewton<Cone>::merit(const Function& f, const Vector& u, const Vector& r) const {
  double sum = 0;
  for (Index a = 0; a < problem_.nc(); ++a) {
    sum += f.value(Cone(problem_.friction, a), rho_of(f, a), u.template segment<D>(D * a),
                   r.template segment<D>(D * a))
               .squaredNorm();
  }
  return 0.5 * sum;
}

template <class Cone>
double SemismoothNewton<Cone>::slope(const Function& f) const {
  double sum = 0;
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Cone cone(problem_.friction, a);
    const Vec rho = rho_of(f, a);
    const Vec u = u_.template segment<D>(D * a);
    const Vec r = r_.template segment<D>(D * a);
    Mat A;
    Mat B;
    f.jacobian(cone, rho, u, r, A, B);
    const Vec change = A * du_.template segment<D>(D * a) + B * dr_.template segment<D>(D * a);
    sum += f.value(cone, rho, u, r).dot(change);
  }
  return sum;
}

template <class Cone>
void SemismoothNewton<Cone>::descend(const Function& f) {
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Cone cone(problem_.friction, a);
    const Vec rho = rho_of(f, a);
    const Vec u = u_.template segment<D>(D * a);
    const Vec r = r_.template segment<D>(D * a);
    Mat A;
    Mat B;
    f.jacobian(cone, rho, u, r, A, B);
    const Vec value = f.value(cone, rho, u, r);
    gradient_.template segment<D>(D * a) = B.transpose() * value;
    du_.template segment<D>(D * a) = A.transpose() * value;
  }
  problem_.W.multiply_add(du_, gradient_, dr_);
  dr_ = -dr_;
  move();
  double squared = 0;  // ||(B + A W) dr||^2
  for (Index a = 0; a < problem_.nc(); ++a) {
    Mat A;
    Mat B;
    f.jacobian(Cone(problem_.friction, a), rho_of(f, a), u_.template segment<D>(D * a),
               r_.template segment<D>(D * a), A, B);
    squared +=
        (A * du_.template segment<D>(D * a) + B * dr_.template segment<D>(D * a)).squaredNorm();
  }
  const double length = squared > 0 ? dr_.squaredNorm() / squared : 0;
  dr_ *= length;
  du_ *= length;
}

template <class Cone>
void SemismoothNewton<Cone>::move() {
  gradient_.setZero();
  problem_.W.multiply_add(dr_, gradient_, du_);
}

template <class Cone>
double SemismoothNewton<Cone>::merit_at(const Function& f, double length) {
  trial_r_ = r_ + length * dr_;
  trial_u_ = u_ + length * du_;
  return merit(f, trial_u_, trial_r_);
}

template <class Cone>
double SemismoothNewton<Cone>::armijo(const Function& f, double start, double slope) {
  double length = 1;
  for (int k = 0; k < max_trials; ++k, length *= 0.5) {
    if (merit_at(f, length) <= start + least_decrease * length * slope) return length;
  }
  return 0;
}

template <class Cone>
double SemismoothNewton<Cone>::goldstein_price(const Function& f, double start, double slope) {
  double length = 1;
  double low = 0;
  double high = std::numeric_limits<double>::infinity();
  for (int k = 0; k < max_trials; ++k) {
    const double share = (merit_at(f, length) - start) / (length * slope);
    if (share >= low_share && share <= high_share) return length;
    (share > high_share ? low : high) = length;
    length = high < std::numeric_limits<double>::infinity() ? 0.5 * (low + high) : 10 * length;
  }
  return low;
}

template <class Cone>
double SemismoothNewton<Cone>::search(LineSearch rule) {
  if (rule == LineSearch::none) return dr_.allFinite() ? 1.0 : 0.0;
  if constexpr (Cone::groups == 1) {
    constexpr auto other = ContactFunctionKind::fischer_burmeister;
    if (rule == LineSearch::fischer_burmeister && kind_ != other)
      return search_by(contact_function<Cone>(other), rule);
  }
  return search_by(function_, rule);
}

template <class Cone>
double SemismoothNewton<Cone>::search_by(const Function& f, LineSearch rule) {
  const double start = merit(f, u_, r_);
  for (const bool newton : {true, false}) {
    if (newton) {
      if (!dr_.allFinite()) continue;
      move();
    } else {
      descend(f);
      if (!dr_.allFinite()) return 0;
    }
    const double along = slope(f);
    if (!(along < 0)) continue;
    const double length = rule == LineSearch::goldstein_price ? goldstein_price(f, start, along)
                                                              : armijo(f, start, along);
    if (length > 0) return length;
  }
  return 0;
}

#define FCLIB_INSTANTIATE(Cone) template class SemismoothNewton<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
