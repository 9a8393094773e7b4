// What the semismooth Newton solvers share: their options, a run under a Monitor, and the entry of
// all of them in the registry.
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
        OptionField<O, RhoRule>{
            .name = "rho_rule",
            .member = &O::rho_rule,
            .doc = "rho of each contact: constant; 1 / the spectral norm of W_aa; that of its "
                   "normal and tangential parts (the first alone where the function takes one "
                   "rho); or adaptive, such that a step moves rho u^ about as much as r",
            .choices = rho_rules},
        OptionField<O, double>{.name = "rho",
                               .member = &O::rho,
                               .unit = "1/[W] where the rule is constant, else 1",
                               .doc = "rho itself, or a factor of what the rule gives",
                               .lowest = 1e-12,
                               .highest = 1e12},
        OptionField<O, LineSearch>{
            .name = "line_search",
            .member = &O::line_search,
            .doc = "none, or on 1/2 ||F||^2: armijo or goldstein_price; fischer_burmeister is "
                   "armijo on the merit of that function (rolling contacts: on 1/2 ||F||^2)",
            .choices = line_searches},
        OptionField<O, double>{.name = "regularisation",
                               .member = &O::regularisation,
                               .unit = "mean of tr(W_aa) / d",
                               .doc = "added to the diagonal of W in Newton's system, times the "
                                      "error where that is less than 1",
                               .lowest = 0,
                               .highest = 1e6},
        OptionField<O, std::int64_t>{.name = "sweeps",
                                     .member = &O::sweeps,
                                     .unit = "sweeps",
                                     .doc = "of Gauss-Seidel where Newton stands still, twice as "
                                            "many each time up to 1000; 0: it ends there",
                                     .lowest = 0,
                                     .highest = 1000},
        OptionField<O, std::int64_t>{.name = "patience",
                                     .member = &O::patience,
                                     .unit = "iterations",
                                     .doc = "in which the error must halve, or Newton stands still",
                                     .lowest = 1},
    };
  }
};

/// The entry of the solver with this function. An iteration is a step of Newton, or the sweeps in
/// the place of one.
Solver newton_entry(std::string name, std::string title, std::string citation,
                    std::vector<int> rolling_dimensions, ContactFunctionKind function);

}  // namespace fclib
