// PPA-NSGS: the proximal point algorithm, its inner problems solved by nonsmooth Gauss-Seidel.
//
//   r_{k+1} = solution of the contact problem with W + alpha_k I and q - alpha_k r_k
//   alpha_k = constant, or sigma error_k^nu
//
// Section 7 of Acary, Bremond, Huber, "On solving contact problems with Coulomb friction:
// formulations and numerical comparisons" (2018); Rockafellar, "Monotone operators and the proximal
// point algorithm" (1976).
//
// Differs from the papers in: alpha is relative to the mean of tr(W_aa) / d. An inner problem is
// solved until its error is a fraction of the error at r_k, or for a number of sweeps. If these end
// farther away than they began, r_k is taken again with four times the alpha, which falls back
// afterwards: with a small alpha, Gauss-Seidel may move away from a solution. W is not changed;
// alpha enters the one-contact problems. If nsgs alone converges, it is faster: this solver is for
// problems whose W is singular.

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "contact/local_solver.hpp"
#include "methods/shared_options.hpp"
#include "reduced/relative_error.hpp"
#include "reduced/scale.hpp"
#include "solve/by_cone.hpp"
#include "solve/solver.hpp"

namespace fclib::ppa_nsgs {

namespace {

enum class Rule { error, constant };
constexpr std::array<std::string_view, 2> rules{"error", "constant"};

struct Options : ProximalOptions {
  Rule rule = Rule::error;
  double inner_accuracy = 0.1;
  std::int64_t inner_sweeps = 100;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple_cat(
        std::tuple{choice("rule", &O::rule, rules,
                          "What alpha is: sigma error^nu, at most sigma, or a constant.")},
        proximal_fields<O>("mean of tr(W_aa) / d", "The constant alpha."),
        std::tuple{option("inner_accuracy", &O::inner_accuracy, "1", {1e-6, 0.99},
                          "The error of an inner solution, over that of the outer one."),
                   option("inner_sweeps", &O::inner_sweeps, "sweeps", {1, 1e6},
                          "The largest number of sweeps of an inner solution.")});
  }
};

template <class Cone>
class Iteration {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;
  using Mat = ContactMatrix<D>;

  Iteration(const ReducedProblem& problem, const Vector& r)
      : problem_(problem), size_(mean_diagonal(problem)), r_(r), anchor_(r) {
    problem.velocity(r_, u_);
    shifted_ = u_;
    for (Index a = 0; a < problem.nc(); ++a) {
      const Mat block = problem.W.template diagonal_block<D>(a);
      contacts_.emplace_back(block, Cone(problem.friction, a));
    }
  }

  [[nodiscard]] double size() const { return size_; }
  [[nodiscard]] const Vector& r() const { return r_; }

  /// The error of r.
  [[nodiscard]] double error() const { return relative_error<Cone>(problem_, u_, r_); }

  /// The error of r in the inner problem.
  double inner_error() {
    shifted_ = u_ + alpha_ * (r_ - anchor_);
    return relative_error<Cone>(problem_, shifted_, r_);
  }

  /// Drops the inner iterates: r is r_k again.
  void go_back() { r_ = anchor_; }

  /// r_k becomes the present r, and u is recomputed.
  void start_inner(double alpha) {
    problem_.velocity(r_, u_);
    anchor_ = r_;
    if (alpha == alpha_) return;
    alpha_ = alpha;
    for (Index a = 0; a < problem_.nc(); ++a) {
      const Mat block = problem_.W.template diagonal_block<D>(a) + alpha * Mat::Identity();
      contacts_[static_cast<std::size_t>(a)] =
          ContactProblem<Cone>(block, Cone(problem_.friction, a));
    }
  }

  void sweep() {
    const LocalStep<Cone> step;
    for (Index a = 0; a < problem_.nc(); ++a) {
      ContactProblem<Cone>& contact = contacts_[static_cast<std::size_t>(a)];
      const Vec old = r_.template segment<D>(D * a);
      const Vec anchor = anchor_.template segment<D>(D * a);
      // u + alpha (r - r_k) without the part of the contact's own reaction
      const Vec b =
          u_.template segment<D>(D * a) + alpha_ * (old - anchor) - contact.projected.block() * old;
      Vec next = old;
      step(contact, b, next);
      const Vec delta = next - old;
      if ((delta.array() == 0).all()) continue;
      r_.template segment<D>(D * a) = next;
      problem_.W.template add_column<D>(a, delta.data(), u_.data());
    }
  }

 private:
  const ReducedProblem& problem_;
  double size_;  // the mean of tr(W_aa) / d
  std::vector<ContactProblem<Cone>> contacts_;
  double alpha_ = 0;
  Vector r_, u_, anchor_, shifted_;
};

/// The number of sweeps between two evaluations of the errors.
constexpr std::int64_t interval = 5;

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, const Settings& settings,
                Vector& r) {
  Monitor monitor(settings);
  Iteration<Cone> at(problem, r);
  double error = at.error();
  if (const auto stop = monitor.report(0, error, &r)) return {*stop, 0};
  double best = error;
  std::int64_t sweeps = 0;
  double caution = 1;  // factor of alpha, after inner problems that were not solved
  for (;;) {
    const double alpha = options.rule == Rule::constant
                             ? options.alpha
                             : options.sigma * std::pow(std::min(error, 1.0), options.nu);
    const double start = error;
    at.start_inner(caution * alpha * at.size());
    double inner_error = start;
    for (std::int64_t inner = 0; inner < options.inner_sweeps;) {
      const std::int64_t count =
          std::min({interval, options.inner_sweeps - inner, monitor.max_iterations() - sweeps});
      for (std::int64_t k = 0; k < count; ++k) at.sweep();
      inner += count;
      sweeps += count;
      error = at.error();
      if (error < best) {
        best = error;
        r = at.r();
      }
      if (const auto stop = monitor.report(sweeps, error, &at.r())) return {*stop, sweeps};
      inner_error = at.inner_error();
      if (inner_error <= options.inner_accuracy * start) break;
    }
    if (inner_error >= start) {
      at.go_back();
      error = start;
      caution *= 4;
    } else {
      caution = std::max(1.0, 0.5 * caution);
    }
  }
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "ppa-nsgs",
      .family = "proximal point",
      .title = "Proximal point over nonsmooth Gauss-Seidel",
      .citation = "Rockafellar 1976; Acary, Bremond & Huber 2018",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .options = describe_options<Options>(),
      .max_iterations = 1'000'000,
      .solve = by_cone<Options>([]<class Cone>(auto&... all) { return iterate<Cone>(all...); }),
  };
  return entry;
}

}  // namespace fclib::ppa_nsgs
