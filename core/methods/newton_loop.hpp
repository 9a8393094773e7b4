// What the semismooth Newton solvers share: their options, a run under a Monitor, and the entry of
// each of them in the registry.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "methods/semismooth_newton.hpp"
#include "solve/solver.hpp"

namespace fclib {

inline constexpr std::array<std::string_view, 4> rho_rules{"constant", "spectral", "split_spectral",
                                                           "adaptive"};
inline constexpr std::array<std::string_view, 4> line_searches{"none", "armijo", "goldstein_price",
                                                               "fischer_burmeister"};

struct NewtonOptions : NewtonRules {
  static constexpr auto fields() {
    using O = NewtonOptions;
    return std::tuple{
        choice("rho_rule", &O::rho_rule, rho_rules,
               "rho of each contact. constant: the same for all. spectral: 1 / the spectral norm "
               "of W_aa. split_spectral: that of its normal and of its tangential part; the first "
               "alone if the function takes one rho. adaptive: such that a step moves rho u^ about "
               "as much as r."),
        option("rho", &O::rho, "1/[W] if the rule is constant, else 1", {1e-12, 1e12},
               "rho itself, or a factor on what the rule gives."),
        choice(
            "line_search", &O::line_search, line_searches,
            "armijo and goldstein_price search on 1/2 ||F||^2. fischer_burmeister is armijo on "
            "the merit of that function; for contacts with rolling or spin friction it is armijo."),
        option("regularisation", &O::regularisation, "mean of tr(W_aa) / d", {0, 1e6},
               "What is added to the diagonal of W in Newton's system. It is multiplied by the "
               "error if that is less than 1."),
        option("sweeps", &O::sweeps, "sweeps", {0, 1000},
               "The number of sweeps of Gauss-Seidel if Newton stands still: twice as many each "
               "time, up to 1000. 0: it ends then."),
        option("patience", &O::patience, "iterations", {1},
               "Newton stands still if the error does not halve in so many iterations."),
    };
  }
};

/// The entry of the solver with this function. An iteration is a Newton step, or the sweeps that
/// replace one.
Solver newton_entry(std::string name, std::string title, std::string citation,
                    std::vector<int> rolling_dimensions, ContactFunctionKind function);

}  // namespace fclib
