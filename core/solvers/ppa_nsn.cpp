// PPA-NSN: the proximal point algorithm, its inner problems solved by a semismooth Newton method.
//
//   r_{k+1} = solution of the contact problem with W + alpha_k I and q - alpha_k r_k
//   alpha_k = constant, or sigma error_k^nu
//
// Section 7 of Acary, Bremond, Huber, "On solving contact problems with Coulomb friction:
// formulations and numerical comparisons" (2018); Rockafellar, "Monotone operators and the proximal
// point algorithm" (1976).
//
// Differs from the papers in: alpha is relative to tr(W_aa) / d of each contact. It doubles if
// Newton's method fails, and falls back afterwards. Inner problems are solved by Newton's method on
// the function of Alart & Curnier in the variable r - rho u (methods/proximal_point.hpp), until
// their residual is a fraction of the error. By default, alpha follows the number of Newton steps
// and not the error. The operator is not monotone: no step is proved to approach the solution.

#include <array>

#include "methods/proximal_point.hpp"
#include "methods/shared_options.hpp"
#include "reduced/relative_error.hpp"
#include "solve/by_cone.hpp"
#include "solve/solver.hpp"

namespace fclib::ppa_nsn {

namespace {

enum class Rule { steps, error, constant };
constexpr std::array<std::string_view, 3> rules{"steps", "error", "constant"};

struct Options : ProximalOptions {
  Rule rule = Rule::steps;
  double alpha_min = 1e-8;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple_cat(
        std::tuple{choice(
            "rule", &O::rule, rules,
            "What alpha is: less if Newton takes fewer steps, sigma error^nu, or a constant.")},
        proximal_fields<O>("tr(W_aa) / d", "alpha at first, and the constant alpha."),
        std::tuple{
            option("alpha_min", &O::alpha_min, "tr(W_aa) / d", {1e-15, 1}, "The least alpha.")});
  }

  [[nodiscard]] ProximalRules to_rules() const {
    ProximalRules result{.kappa = 1 / alpha,
                         .kappa_max = 1 / alpha_min,
                         .patience = std::numeric_limits<double>::infinity(),
                         .max_factorisations = 4000};
    if (rule == Rule::steps) return result;
    result.law = ProximalRules::Law::by_error;
    result.sigma = rule == Rule::constant ? alpha : sigma;
    result.nu = rule == Rule::constant ? 0 : nu;
    return result;
  }
};

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, const Settings& settings,
                Vector& r) {
  Monitor monitor(settings);
  Vector u;
  problem.velocity(r, u);
  const double error = relative_error<Cone>(problem, u, r);
  if (const auto stop = monitor.report(0, error, &r)) return {*stop, 0};

  CoupledSystem system(problem);
  ProximalPoint<Cone> method(problem, system);
  std::int64_t iterations = 0;
  std::optional<Status> stopped;
  method.solve(options.to_rules(), monitor.tolerance(), r, [&](double at) {
    stopped = monitor.report(++iterations, at, &r);
    return stopped.has_value();
  });
  return {stopped.value_or(Status::stalled), iterations};
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "ppa-nsn",
      .family = "proximal point",
      .title = "Proximal point over nonsmooth Newton",
      .citation = "Rockafellar 1976; Acary, Bremond & Huber 2018",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .spin_dimensions = {4, 6},
      .options = describe_options<Options>(),
      .max_iterations = 10'000,
      .solve = by_cone<Options>([]<class Cone>(auto&... all) { return iterate<Cone>(all...); }),
  };
  return entry;
}

}  // namespace fclib::ppa_nsn
