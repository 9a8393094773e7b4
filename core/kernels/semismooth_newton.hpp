// Semismooth Newton on F(u, r) = 0, u = W r + q, for any function of contact_functions.hpp:
//
//   (B + A W) dr = -F,   A = dF/du, B = dF/dr,   r <- r + t dr
//
// with t = 1, or from a line search on theta = 1/2 ||F||^2 or that of Fischer & Burmeister's
// function. There, where Newton's step is no descent, or no t is found, minus the gradient is
// searched instead; where the error stands still, sweeps of Gauss-Seidel from the best iterate
// start it anew.
//
// Without enough coordinates for its contacts W is singular, and B + A W with it: W + delta I
// stands in its place, with delta going to zero as the error does.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "kernels/contact_functions.hpp"
#include "kernels/coupled_system.hpp"
#include "kernels/gauss_seidel.hpp"
#include "kernels/natural_error.hpp"
#include "linalg/spectral_norm.hpp"

namespace fclib {

enum class RhoRule {
  constant,        ///< one for all
  spectral,        ///< 1 / the spectral norm of W_aa
  split_spectral,  ///< 1 / W_NN, and 1 / the spectral norm of each tangential block
  adaptive,        ///< spectral, then such that a step moves rho u^ about as much as r
};

enum class LineSearch {
  none,
  armijo,             ///< halvings, until theta falls by a share of its slope
  goldstein_price,    ///< neither too long nor too short, by bisection
  fischer_burmeister  ///< armijo on the merit of Fischer & Burmeister's function
};

struct NewtonRules {
  RhoRule rho_rule = RhoRule::spectral;
  double rho = 1;  ///< 1/[W] where constant, else a factor
  LineSearch line_search = LineSearch::none;
  double regularisation = 1;   ///< delta over the mean of tr(W_aa) / d and the error
  std::int64_t sweeps = 10;    ///< of Gauss-Seidel where Newton stands still, then twice as many
  std::int64_t patience = 20;  ///< steps in which the error must halve
};

enum class NewtonEnd { reported, stalled, not_finite };

template <class Function>
class SemismoothNewton {
 public:
  using Cone = typename Function::Cone;
  static constexpr int D = Cone::dim;
  static constexpr bool has_fischer_burmeister = std::is_same_v<Cone, Coulomb<D>>;
  using Vec = typename Cone::Vec;
  using Mat = ContactMatrix<D>;

  explicit SemismoothNewton(const Delassus& problem, int threads = 1)
      : problem_(problem),
        system_(problem, CoupledSystem::Form::general, threads),
        contacts_(problem) {
    const auto m = problem.m();
    for (Vector* v : {&f_, &r_, &u_, &dr_, &du_, &trial_r_, &trial_u_, &gradient_, &rho_, &base_})
      v->setZero(m);
    spectral_norm_.resize(problem.nc());
  }

  [[nodiscard]] const CoupledSystem& system() const { return system_; }
  [[nodiscard]] std::int64_t factorisations() const { return system_.factorisations(); }

  /// Improves r. `report(error)` is told of each iterate, and ends it by returning true. r ends as
  /// the iterate with the least error.
  template <class Report>
  NewtonEnd solve(const NewtonRules& rules, Vector& r, const Report& report) {
    choose_rho(rules);
    r_ = r;
    problem_.velocity(r_, u_);
    double error = error_of(u_, r_);
    double best = error;
    double mark = error;  // the error must halve from here
    double at_restart = error;
    std::int64_t since = 0;
    const auto accept = [&] {
      error = error_of(u_, r_);
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
      if (!system_.factorise()) return NewtonEnd::not_finite;
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

 private:
  using FB = FischerBurmeister<Coulomb<D>>;

  static constexpr double least_decrease = 1e-4;  // of theta, over its slope: Armijo's
  static constexpr double low_share = 0.01;       // Goldstein & Price's
  static constexpr double high_share = 0.99;
  static constexpr int max_trials = 30;
  static constexpr std::int64_t sweeps_at_once = 10;  // between reports
  static constexpr std::int64_t most_sweeps = 1000;

  double error_of(const Vector& u, const Vector& r) const {
    return std::sqrt(natural_map_squared<Cone>(u, r, problem_.friction)) / problem_.scale;
  }

  void choose_rho(const NewtonRules& rules) {
    size_ = 0;
    for (Index a = 0; a < problem_.nc(); ++a) {
      size_ +=
          problem_.W.template diagonal_block<D>(a).trace() / D / static_cast<double>(problem_.nc());
    }
    if (!(size_ > 0)) size_ = 1;
    const auto inverse = [&](double x) { return 1 / (x > 1e-12 * size_ ? x : size_); };
    for (Index a = 0; a < problem_.nc(); ++a) {
      const Mat w = problem_.W.template diagonal_block<D>(a);
      auto rho = base_.template segment<D>(D * a);
      spectral_norm_[a] = spectral_norm(w);
      rho.setConstant(inverse(spectral_norm_[a]));
      if (rules.rho_rule == RhoRule::constant) rho.setOnes();
      if (Function::split && rules.rho_rule == RhoRule::split_spectral) {
        constexpr int S = Cone::group_size;
        rho[0] = inverse(w(0, 0));
        for (int g = 0; g < Cone::groups; ++g) {
          const int at = 1 + g * S;
          const double norm = spectral_norm(w.template block<S, S>(at, at));
          rho.template segment<S>(at).setConstant(inverse(norm));
        }
      }
      rho *= rules.rho;
    }
    rho_ = base_;
  }

  /// Khobotov's rule on each contact: rho ||du^|| <= 0.9 ||dr||, and not far from it.
  void adapt_rho() {
    for (Index a = 0; a < problem_.nc(); ++a) {
      const Cone cone(problem_.friction, a);
      const double dr =
          (trial_r_.template segment<D>(D * a) - r_.template segment<D>(D * a)).norm();
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

  void sweep(std::int64_t count) {
    for (std::int64_t k = 0; k < count; ++k) contacts_.sweep(r_, u_);
    problem_.velocity(r_, u_);
  }

  /// F at (u, r), and the blocks of the system.
  void assemble(double delta) {
    double* a_blocks = system_.blocks().data();
    double* b_blocks = system_.own_blocks().data();
    for (Index a = 0; a < problem_.nc(); ++a) {
      const Cone cone(problem_.friction, a);
      const Vec rho = rho_.template segment<D>(D * a);
      const Vec u = u_.template segment<D>(D * a);
      const Vec r = r_.template segment<D>(D * a);
      Mat A;
      Mat B;
      f_.template segment<D>(D * a) = Function::value(cone, rho, u, r);
      Function::slopes(cone, rho, u, r, A, B);
      B += delta * A;
      Eigen::Map<Mat>(a_blocks + std::ptrdiff_t{D * D} * a) = A;
      Eigen::Map<Mat>(b_blocks + std::ptrdiff_t{D * D} * a) = B;
    }
  }

  template <class F>
  Vec rho_of(Index a) const {
    if constexpr (std::is_same_v<F, Function>) {
      return rho_.template segment<D>(D * a);
    } else {
      return Vec::Constant(spectral_norm_[a] > 1e-12 * size_ ? 1 / spectral_norm_[a] : 1 / size_);
    }
  }

  /// theta = 1/2 ||F||^2.
  template <class F>
  double merit(const Vector& u, const Vector& r) const {
    double sum = 0;
    for (Index a = 0; a < problem_.nc(); ++a) {
      sum += F::value(Cone(problem_.friction, a), rho_of<F>(a), u.template segment<D>(D * a),
                      r.template segment<D>(D * a))
                 .squaredNorm();
    }
    return 0.5 * sum;
  }

  /// The slope of theta along dr_, du_ = W dr_.
  template <class F>
  double slope() const {
    double sum = 0;
    for (Index a = 0; a < problem_.nc(); ++a) {
      const Cone cone(problem_.friction, a);
      const Vec rho = rho_of<F>(a);
      const Vec u = u_.template segment<D>(D * a);
      const Vec r = r_.template segment<D>(D * a);
      Mat A;
      Mat B;
      F::slopes(cone, rho, u, r, A, B);
      const Vec change = A * du_.template segment<D>(D * a) + B * dr_.template segment<D>(D * a);
      sum += F::value(cone, rho, u, r).dot(change);
    }
    return sum;
  }

  /// dr_ <- minus the gradient of theta, for symmetric W, as long as Newton's model asks for.
  template <class F>
  void descend() {
    for (Index a = 0; a < problem_.nc(); ++a) {
      const Cone cone(problem_.friction, a);
      const Vec rho = rho_of<F>(a);
      const Vec u = u_.template segment<D>(D * a);
      const Vec r = r_.template segment<D>(D * a);
      Mat A;
      Mat B;
      F::slopes(cone, rho, u, r, A, B);
      const Vec f = F::value(cone, rho, u, r);
      gradient_.template segment<D>(D * a) = B.transpose() * f;
      du_.template segment<D>(D * a) = A.transpose() * f;
    }
    problem_.W.multiply_add(du_, gradient_, dr_);
    dr_ = -dr_;
    move();
    double squared = 0;  // ||(B + A W) dr||^2
    for (Index a = 0; a < problem_.nc(); ++a) {
      Mat A;
      Mat B;
      F::slopes(Cone(problem_.friction, a), rho_of<F>(a), u_.template segment<D>(D * a),
                r_.template segment<D>(D * a), A, B);
      squared +=
          (A * du_.template segment<D>(D * a) + B * dr_.template segment<D>(D * a)).squaredNorm();
    }
    const double length = squared > 0 ? dr_.squaredNorm() / squared : 0;
    dr_ *= length;
    du_ *= length;
  }

  /// du_ = W dr_.
  void move() {
    gradient_.setZero();
    problem_.W.multiply_add(dr_, gradient_, du_);
  }

  template <class F>
  double merit_at(double length) {
    trial_r_ = r_ + length * dr_;
    trial_u_ = u_ + length * du_;
    return merit<F>(trial_u_, trial_r_);
  }

  /// Halvings from 1; 0 where none will do.
  template <class F>
  double armijo(double start, double slope) {
    double length = 1;
    for (int k = 0; k < max_trials; ++k, length *= 0.5) {
      if (merit_at<F>(length) <= start + least_decrease * length * slope) return length;
    }
    return 0;
  }

  /// low_share <= (theta(t) - theta) / (t slope) <= high_share; 0 where no t is found.
  template <class F>
  double goldstein_price(double start, double slope) {
    double length = 1;
    double low = 0;
    double high = std::numeric_limits<double>::infinity();
    for (int k = 0; k < max_trials; ++k) {
      const double share = (merit_at<F>(length) - start) / (length * slope);
      if (share >= low_share && share <= high_share) return length;
      (share > high_share ? low : high) = length;
      length = high < std::numeric_limits<double>::infinity() ? 0.5 * (low + high) : 10 * length;
    }
    return low;
  }

  /// The length of the step along dr_, which may become another direction; 0 where there is none.
  double search(LineSearch rule) {
    if (rule == LineSearch::none) return dr_.allFinite() ? 1.0 : 0.0;
    if constexpr (has_fischer_burmeister) {
      if (rule == LineSearch::fischer_burmeister) return search_by<FB>(rule);
    }
    return search_by<Function>(rule);
  }

  template <class F>
  double search_by(LineSearch rule) {
    const double start = merit<F>(u_, r_);
    for (const bool newton : {true, false}) {
      if (newton) {
        if (!dr_.allFinite()) continue;
        move();
      } else {
        descend<F>();
        if (!dr_.allFinite()) return 0;
      }
      const double along = slope<F>();
      if (!(along < 0)) continue;
      const double length = rule == LineSearch::goldstein_price ? goldstein_price<F>(start, along)
                                                                : armijo<F>(start, along);
      if (length > 0) return length;
    }
    return 0;
  }

  const Delassus& problem_;
  CoupledSystem system_;
  GaussSeidel<Cone> contacts_;
  double size_ = 1;       // the mean of tr(W_aa) / d
  Vector spectral_norm_;  // of each W_aa
  Vector base_, rho_;     // of each component
  Vector f_, r_, u_, dr_, du_, trial_r_, trial_u_, gradient_;
};

}  // namespace fclib
