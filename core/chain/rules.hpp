// A chain of methods as data: which stages there are, when each applies, what it starts from and
// what it may cost. `auto` is one such table (solvers/automatic.cpp); a user may give another.
//
// In text, a line (or what ";" ends) is a stage; "#" begins a comment:
//
//   NAME : METHOD key=value ...
//
// NAME is what results call the stage, METHOD one of the structs below. The keys of `When` say
// where the stage applies, the others are the method's own. Every threshold of a chain is a field
// of this file, with its meaning and unit.
//
// What a stage may cost is counted in its own steps or in operations, never in time: the same
// problem takes the same path on every machine.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <tuple>
#include <variant>
#include <vector>

#include "contact/contact_functions.hpp"
#include "methods/held_bodies.hpp"
#include "methods/homotopy.hpp"
#include "methods/interior_point.hpp"
#include "methods/proximal_point.hpp"
#include "methods/semismooth_newton.hpp"
#include "methods/shared_options.hpp"
#include "methods/spectral_gradient.hpp"
#include "solve/options.hpp"

namespace fclib::chain {

// ---- where a stage applies

enum class On { whole, islands };
inline constexpr std::array<std::string_view, 2> on_names{"whole", "islands"};

enum class Law { any, coulomb, rolling };
inline constexpr std::array<std::string_view, 3> law_names{"any", "coulomb", "rolling"};

enum class Bodies { any, fewer, more };
inline constexpr std::array<std::string_view, 3> bodies_names{"any", "fewer", "more"};

struct When {
  On on = On::islands;
  std::int64_t at_least = 0;
  std::int64_t at_most = 0;
  double below = 0;
  bool guessed = false;
  double jointed = 0;
  Bodies bodies = Bodies::any;
  Law law = Law::any;

  static constexpr auto fields() {
    using O = When;
    return std::tuple{
        OptionField<O, On>{.name = "on",
                           .member = &O::on,
                           .doc = "all contacts at once, or each island of contacts linked by W "
                                  "that is left",
                           .choices = on_names},
        OptionField<O, std::int64_t>{.name = "at_least",
                                     .member = &O::at_least,
                                     .unit = "contacts",
                                     .doc = "that there must be",
                                     .lowest = 0},
        OptionField<O, std::int64_t>{.name = "at_most",
                                     .member = &O::at_most,
                                     .unit = "contacts",
                                     .doc = "that there may be; 0: any number",
                                     .lowest = 0},
        OptionField<O, double>{.name = "below",
                               .member = &O::below,
                               .unit = "1",
                               .doc = "error under which the stage is tried; 0: any",
                               .lowest = 0},
        OptionField<O, bool>{
            .name = "guessed", .member = &O::guessed, .doc = "only where there is a guess"},
        OptionField<O, double>{.name = "jointed",
                               .member = &O::jointed,
                               .unit = "1",
                               .doc = "only where bilateral constraints take more than this share "
                                      "of the mobility of a contact; 0: anywhere",
                               .lowest = 0,
                               .highest = 1},
        OptionField<O, Bodies>{.name = "bodies",
                               .member = &O::bodies,
                               .doc = "whether the bodies must have at most half as many "
                                      "coordinates as the contacts (fewer), or not (more)",
                               .choices = bodies_names},
        OptionField<O, Law>{.name = "law",
                            .member = &O::law,
                            .doc = "Coulomb's cone alone, rolling ones alone, or both",
                            .choices = law_names},
    };
  }
};

// ---- what it starts from

enum class Start { nothing, best, swept, associated };
inline constexpr std::array<std::string_view, 4> start_names{"nothing", "best", "swept",
                                                             "associated"};
inline constexpr std::string_view start_doc =
    "r = 0, the best iterate so far, that which there was when the chain came to the first stage "
    "from one of the next two, or the associated problem's on its way (swept where it has none)";

template <class O>
constexpr auto start_field() {
  return OptionField<O, Start>{
      .name = "from", .member = &O::from, .doc = start_doc, .choices = start_names};
}

template <class O, class Limit>
constexpr auto limit_field(Limit O::* member, std::string_view unit, std::string_view doc) {
  return OptionField<O, Limit>{
      .name = "limit", .member = member, .unit = unit, .doc = doc, .lowest = 1, .highest = 1e9};
}

/// Operations, about: of a sweep for a contact, beside one for each entry of W, and of a
/// factorisation with its solve and the rest of an iteration, beside its multiplications.
inline constexpr double sweep_operations = 60;
inline constexpr double iteration_operations = 1500;

/// From an iterate that is nearly a solution, the way to one may lead over errors that are far
/// larger.
inline constexpr double endless = std::numeric_limits<double>::infinity();

// ---- the methods

/// Sweeps over the contacts, from the iterate that the whole or the island came with.
struct GaussSeidelStage {
  static constexpr std::string_view name = "gauss_seidel";
  static constexpr std::string_view families = "splitting";
  static constexpr std::string_view doc = "sweeps of nonsmooth Gauss-Seidel";
  std::int64_t limit = 100;
  std::int64_t interval = 5;
  std::int64_t few = 10;
  double worth = 12;
  double extension = 20;

  static constexpr auto fields() {
    using O = GaussSeidelStage;
    return std::tuple{
        limit_field<O, std::int64_t>(&O::limit, "sweeps", "at most, more where they converge soon"),
        OptionField<O, std::int64_t>{.name = "interval",
                                     .member = &O::interval,
                                     .unit = "sweeps",
                                     .doc = "between two looks at the error",
                                     .lowest = 2,
                                     .highest = 1e6},
        OptionField<O, std::int64_t>{.name = "few",
                                     .member = &O::few,
                                     .unit = "contacts",
                                     .doc = "up to which the error is looked at after one, three "
                                            "and five sweeps: it costs no more than they",
                                     .lowest = 0},
        OptionField<O, double>{.name = "worth",
                               .member = &O::worth,
                               .unit = "factorisations",
                               .doc = "that the sweeps to go, at their rate, may cost; 0: any",
                               .lowest = 0},
        OptionField<O, double>{.name = "extension",
                               .member = &O::extension,
                               .unit = "limits",
                               .doc = "of sweeps to go, under which they go on beyond their limit",
                               .lowest = 0},
    };
  }
};

/// How long a method goes on whose steps cost little and converge slowly.
struct Patience {
  double worth = 0;
  std::int64_t interval = 10;
  std::int64_t first_look = 50;
  double slack = 2;
};

template <class O>
constexpr auto patience_fields() {
  return std::tuple{
      OptionField<O, double>{.name = "worth",
                             .member = &O::worth,
                             .unit = "factorisations",
                             .doc = "that all steps may cost; where these do not pay for twice the "
                                    "first look the stage is left out; 0: as many as there were",
                             .lowest = 0},
      OptionField<O, std::int64_t>{.name = "interval",
                                   .member = &O::interval,
                                   .unit = "steps",
                                   .doc = "between two looks at the error",
                                   .lowest = 1,
                                   .highest = 1e6},
      OptionField<O, std::int64_t>{.name = "first_look",
                                   .member = &O::first_look,
                                   .unit = "steps",
                                   .doc = "before the first look at the rate; the next ones "
                                          "come after twice as many",
                                   .lowest = 1,
                                   .highest = 1e6},
      OptionField<O, double>{.name = "slack",
                             .member = &O::slack,
                             .unit = "1",
                             .doc = "how many times the steps that are left to be paid for may "
                                    "be needed",
                             .lowest = 0},
  };
}

/// Sweeps from the best iterate: for a loose tolerance they often end where interior points fail,
/// or long before one factorisation would.
struct SweepOnStage : Patience {
  static constexpr std::string_view name = "sweep_on";
  static constexpr std::string_view families = "splitting";
  static constexpr std::string_view doc =
      "sweeps from the best iterate, while they may end for what factorisations cost";

  static constexpr auto fields() { return patience_fields<SweepOnStage>(); }
};

/// Many contacts in a dense W: a factorisation costs as much as thousands of products with W.
struct SpectralGradientStage : Patience {
  static constexpr std::string_view name = "spectral_gradient";
  static constexpr std::string_view families = "optimisation";
  static constexpr std::string_view doc =
      "spectral projected gradients, while they may end for what factorisations cost";
  Start from = Start::best;

  static constexpr auto fields() {
    using O = SpectralGradientStage;
    return std::tuple_cat(std::tuple{start_field<O>()}, patience_fields<O>());
  }
};

/// On W r = -q, preconditioned by tr(W_aa), from the guess or from nothing.
struct ConjugateGradientsStage {
  static constexpr std::string_view name = "conjugate_gradients";
  static constexpr std::string_view families = "krylov";
  static constexpr std::string_view doc =
      "conjugate gradients on W r = -q: all may stick and rest; given up where r leaves the cones";
  std::int64_t limit = 400;
  std::int64_t early = 5;
  std::int64_t trial = 15;
  double outside = 1e-2;
  double exact = 0.01;

  static constexpr auto fields() {
    using O = ConjugateGradientsStage;
    return std::tuple{
        limit_field<O, std::int64_t>(&O::limit, "iterations",
                                     "at most, and left where more are needed"),
        OptionField<O, std::int64_t>{.name = "early",
                                     .member = &O::early,
                                     .unit = "iterations",
                                     .doc = "before the first look at the cones",
                                     .lowest = 1,
                                     .highest = 1e6},
        OptionField<O, std::int64_t>{.name = "trial",
                                     .member = &O::trial,
                                     .unit = "iterations",
                                     .doc = "between two looks at the cones and at the rate",
                                     .lowest = 1,
                                     .highest = 1e6},
        OptionField<O, double>{.name = "outside",
                               .member = &O::outside,
                               .unit = "||r||",
                               .doc = "of r that may be outside the cones",
                               .lowest = 0},
        OptionField<O, double>{.name = "exact",
                               .member = &O::exact,
                               .unit = "tolerance",
                               .doc = "residual at which what is left is that r is not in the "
                                      "cones",
                               .lowest = 0},
    };
  }
};

inline constexpr std::array<std::string_view, 4> function_names{
    "alart_curnier", "jean_moreau", "natural_map", "fischer_burmeister"};

struct NewtonStage : NewtonRules {
  static constexpr std::string_view name = "semismooth_newton";
  static constexpr std::string_view families = "newton";
  static constexpr std::string_view doc = "semismooth Newton, always on the contacts";
  Start from = Start::nothing;
  ContactFunctionKind function = ContactFunctionKind::natural_map;
  std::int64_t limit = 200;
  double most_flops = 0;

  static constexpr auto fields() {
    using O = NewtonStage;
    return std::tuple{
        start_field<O>(),
        limit_field<O, std::int64_t>(&O::limit, "iterations", "of Newton at most"),
        OptionField<O, ContactFunctionKind>{.name = "function",
                                            .member = &O::function,
                                            .doc = "whose zero is sought",
                                            .choices = function_names},
        OptionField<O, std::int64_t>{.name = "sweeps",
                                     .member = &O::sweeps,
                                     .unit = "sweeps",
                                     .doc = "of Gauss-Seidel where Newton stands still, then "
                                            "twice as many",
                                     .lowest = 0,
                                     .highest = 1e6},
        OptionField<O, std::int64_t>{.name = "patience",
                                     .member = &O::patience,
                                     .unit = "iterations",
                                     .doc = "in which the error must halve",
                                     .lowest = 1,
                                     .highest = 1e6},
        OptionField<O, double>{.name = "most_flops",
                               .member = &O::most_flops,
                               .unit = "1",
                               .doc = "operations of a factorisation over that of the other "
                                      "methods, beyond which the stage is left out; 0: any",
                               .lowest = 0},
    };
  }
};

template <class O>
constexpr auto proximal_fields() {
  return std::tuple{
      start_field<O>(),
      limit_field<O, std::int64_t>(&O::max_factorisations, "factorisations", "at most"),
      OptionField<O, double>{.name = "kappa",
                             .member = &O::kappa,
                             .unit = "1",
                             .doc = "rho tr(W_aa) / d at first: the greater, the longer a step",
                             .lowest = 1e-6,
                             .highest = 1e12},
      OptionField<O, double>{.name = "kappa_max",
                             .member = &O::kappa_max,
                             .unit = "1",
                             .doc = "that kappa may grow to",
                             .lowest = 1e-6,
                             .highest = 1e16},
      OptionField<O, double>{.name = "easy",
                             .member = &O::easy,
                             .unit = "1",
                             .doc = "factor on kappa after at most 2 Newton steps",
                             .lowest = 1,
                             .highest = 1e3},
      OptionField<O, double>{.name = "hard",
                             .member = &O::hard,
                             .unit = "1",
                             .doc = "factor on kappa after a failure",
                             .lowest = 1e-3,
                             .highest = 0.999},
      OptionField<O, double>{.name = "patience",
                             .member = &O::patience,
                             .unit = "1",
                             .doc = "error over the best at which it is given up",
                             .lowest = 1},
      OptionField<O, bool>{.name = "wander",
                           .member = &O::wander,
                           .doc = "whether no error is too large to go on from"},
  };
}

/// Where the statuses of the contacts are nearly known.
struct PolishStage : ProximalRules {
  static constexpr std::string_view name = "polish";
  static constexpr std::string_view families = "newton, proximal point";
  static constexpr std::string_view doc =
      "the proximal point with long steps, for the last digits; what other stages polish with";
  Start from = Start::best;
  bool wander = false;

  PolishStage() {
    kappa = 1000;
    easy = 10;
    hard = 0.2;
    max_factorisations = 24;
  }
  static constexpr auto fields() { return proximal_fields<PolishStage>(); }
};

struct ProximalStage : ProximalRules {
  static constexpr std::string_view name = "proximal_point";
  static constexpr std::string_view families = "newton, proximal point";
  static constexpr std::string_view doc = "the proximal point with an accurate inner solution";
  Start from = Start::best;
  bool wander = false;

  ProximalStage() {
    kappa = 10;
    max_factorisations = 200;
  }
  static constexpr auto fields() { return proximal_fields<ProximalStage>(); }
};

/// Of what a path passes near a solution.
template <class O>
constexpr auto polish_fields() {
  return std::tuple{
      OptionField<O, double>{.name = "polish",
                             .member = &O::polish,
                             .unit = "1",
                             .doc = "error under which iterates are polished",
                             .lowest = 0},
      OptionField<O, double>{.name = "again",
                             .member = &O::again,
                             .unit = "1",
                             .doc = "share of the error at which that is tried again, as 1 / again",
                             .lowest = 1},
  };
}

struct InteriorPointStage : InteriorPointRules {
  static constexpr std::string_view name = "interior_point";
  // what it reaches is polished by the proximal point
  static constexpr std::string_view families = "interior point, newton, proximal point";
  static constexpr std::string_view doc =
      "the interior point with de Saxce's term in Newton's system, polished as it comes near; "
      "without smoothing for rolling contacts";
  Start from = Start::swept;
  double far = 0;
  double polish = 1e-5;
  double again = 30;
  double own_accuracy = 1e-7;

  static constexpr auto fields() {
    using O = InteriorPointStage;
    return std::tuple_cat(
        std::tuple{
            start_field<O>(), limit_field<O, int>(&O::max_iterations, "iterations", "at most"),
            OptionField<O, double>{
                .name = "tau",
                .member = &O::tau,
                .unit = "1",
                .doc = "complementarity at first, the least where `far` is given",
                .lowest = 1e-12,
                .highest = 1e6},
            OptionField<O, double>{.name = "far",
                                   .member = &O::far,
                                   .unit = "1",
                                   .doc = "complementarity at first over the error of the start, "
                                          "between tau and 1; 0: tau",
                                   .lowest = 0},
            smoothing_field<O>(), step_cap_field<O>(), delta_field<O>(), patience_field<O>(),
            OptionField<O, double>{.name = "own_accuracy",
                                   .member = &O::own_accuracy,
                                   .unit = "1",
                                   .doc = "tolerance above which its last steps are its own, "
                                          "without a polish",
                                   .lowest = 0}},
        polish_fields<O>());
  }
};

/// Where the associated problem's velocity tends to zero, its reactions solve this one.
struct AssociatedStage {
  static constexpr std::string_view name = "associated";
  static constexpr std::string_view families = InteriorPointStage::families;
  static constexpr std::string_view doc =
      "the interior point on the convex problem, left where its velocity does not tend to zero";
  double near = 1e-4;
  double fast = 0.05;
  double nearer = 1e-6;
  double slow = 1e-3;
  double polish = 1e-5;
  double again = 30;

  static constexpr auto fields() {
    using O = AssociatedStage;
    return std::tuple_cat(
        std::tuple{
            OptionField<O, double>{.name = "near",
                                   .member = &O::near,
                                   .unit = "1",
                                   .doc = "complementarity at which a velocity above `fast` ends "
                                          "it, and its iterate is kept for others to start from",
                                   .lowest = 0},
            OptionField<O, double>{.name = "fast",
                                   .member = &O::fast,
                                   .unit = "||u|| / ||q||",
                                   .doc = "velocity that ends it near",
                                   .lowest = 0},
            OptionField<O, double>{.name = "nearer",
                                   .member = &O::nearer,
                                   .unit = "1",
                                   .doc = "complementarity at which one above `slow` ends it",
                                   .lowest = 0},
            OptionField<O, double>{.name = "slow",
                                   .member = &O::slow,
                                   .unit = "||u|| / ||q||",
                                   .doc = "velocity that ends it nearer",
                                   .lowest = 0}},
        polish_fields<O>());
  }
};

/// The proximal point iterates of the frictionless problem, which is convex, go to infinity along
/// a ray of proof where there is no solution (Pazy 1971), and converge where there is one.
struct NoSolutionStage : ProximalRules {
  static constexpr std::string_view name = "no_solution";
  static constexpr std::string_view families = "newton, proximal point";
  static constexpr std::string_view doc =
      "a proof by Farkas' lemma that there is no solution, which the data as given must confirm";
  double safe_bound = 1e4;

  NoSolutionStage() {
    easy = 100;
    hard = 0.1;
    patience = endless;
    max_factorisations = 60;
  }
  static constexpr auto fields() {
    using O = NoSolutionStage;
    return std::tuple{
        limit_field<O, std::int64_t>(&O::max_factorisations, "factorisations", "at most"),
        OptionField<O, double>{.name = "safe_bound",
                               .member = &O::safe_bound,
                               .unit = "||q|| / mean of tr(W_aa) / d",
                               .doc = "size of reactions that the proof must hold for",
                               .lowest = 0}};
  }
};

/// Where most bodies rest, and reactions that hold them are far from unique.
struct HeldBodiesStage : HeldBodiesRules {
  static constexpr std::string_view name = "held_bodies";
  static constexpr std::string_view families = InteriorPointStage::families;
  static constexpr std::string_view doc =
      "a convex problem on the whole and Coulomb's law on the bodies that move in it, in turn; "
      "problems known by their bodies";
  double polish = 1e-5;
  double again = 10;

  static constexpr auto fields() {
    using O = HeldBodiesStage;
    return std::tuple_cat(
        std::tuple{
            limit_field<O, int>(&O::rounds, "rounds", "of both at most"),
            OptionField<O, int>{.name = "patience",
                                .member = &O::patience,
                                .unit = "rounds",
                                .doc = "in which the error must get better",
                                .lowest = 1,
                                .highest = 1e6},
            OptionField<O, double>{.name = "better",
                                   .member = &O::better,
                                   .unit = "1",
                                   .doc = "share of the least error at which it did",
                                   .lowest = 0,
                                   .highest = 1},
            OptionField<O, double>{.name = "regular",
                                   .member = &O::regular,
                                   .unit = "1",
                                   .doc = "weight of M in the least squares that say how fast a "
                                          "body is, over the traces of H H^T and M",
                                   .lowest = 1e-15,
                                   .highest = 1},
            OptionField<O, double>{
                .name = "rest",
                .member = &O::rest,
                .unit = "||q||_inf",
                .doc = "speed of a body, at one of its contacts, up to which it is held",
                .lowest = 0},
            OptionField<O, double>{
                .name = "most",
                .member = &O::most,
                .unit = "1",
                .doc = "share of the contacts that feel a body which moves, over which it is given "
                       "up where these are not solved at once",
                .lowest = 0},
            OptionField<O, double>{.name = "creep",
                                   .member = &O::creep,
                                   .unit = "error ||q||",
                                   .doc = "the same, by the error of the convex problem's solution",
                                   .lowest = 0},
            OptionField<O, double>{
                .name = "change",
                .member = &O::change,
                .unit = "1",
                .doc = "factor on creep after rounds that held too many or too few",
                .lowest = 1},
            OptionField<O, double>{
                .name = "stuck",
                .member = &O::stuck,
                .unit = "1",
                .doc = "share of its last error at which the convex problem got no better",
                .lowest = 0},
            OptionField<O, double>{.name = "doubt",
                                   .member = &O::doubt,
                                   .unit = "error ||q||",
                                   .doc = "slip up to which a contact is taken to stick, by the "
                                          "error on the bodies that move",
                                   .lowest = 0},
            OptionField<O, double>{.name = "accuracy",
                                   .member = &O::accuracy,
                                   .unit = "1",
                                   .doc = "of the convex problem: complementarity and residual",
                                   .lowest = 0},
            OptionField<O, int>{.name = "convex_limit",
                                .member = &O::convex_limit,
                                .unit = "iterations",
                                .doc = "of the interior point on a convex problem at most",
                                .lowest = 1,
                                .highest = 1e6},
            OptionField<O, double>{.name = "inner",
                                   .member = &O::inner,
                                   .unit = "tolerance",
                                   .doc = "of the bodies that move",
                                   .lowest = 0,
                                   .highest = 1},
            OptionField<O, double>{.name = "interior_above",
                                   .member = &O::interior_above,
                                   .unit = "1",
                                   .doc = "error over which the bodies that move are given to "
                                          "interior points before the proximal point",
                                   .lowest = 0},
            OptionField<O, int>{.name = "sweeps",
                                .member = &O::sweeps,
                                .unit = "sweeps",
                                .doc = "of Gauss-Seidel before these",
                                .lowest = 0,
                                .highest = 1e6},
            OptionField<O, double>{.name = "follow",
                                   .member = &O::follow,
                                   .unit = "1",
                                   .doc = "complementarity at first of the first of them over the "
                                          "error, from least_tau to most_tau",
                                   .lowest = 0},
            OptionField<O, double>{.name = "least_tau",
                                   .member = &O::least_tau,
                                   .unit = "1",
                                   .doc = "see follow",
                                   .lowest = 1e-12,
                                   .highest = 1},
            OptionField<O, double>{.name = "most_tau",
                                   .member = &O::most_tau,
                                   .unit = "1",
                                   .doc = "see follow",
                                   .lowest = 1,
                                   .highest = 1e6},
            OptionField<O, double>{.name = "tau",
                                   .member = &O::tau,
                                   .unit = "1",
                                   .doc = "complementarity at first of the second, from r = 0",
                                   .lowest = 1e-12,
                                   .highest = 1e6},
            step_cap_field<O>(),
            delta_field<O>(),
            OptionField<O, int>{.name = "interior_limit",
                                .member = &O::interior_limit,
                                .unit = "iterations",
                                .doc = "of each at most",
                                .lowest = 1,
                                .highest = 1e6},
            OptionField<O, double>{.name = "kappa",
                                   .member = &O::kappa,
                                   .unit = "1",
                                   .doc = "of the proximal point on these bodies at first",
                                   .lowest = 1e-6,
                                   .highest = 1e12},
            OptionField<O, std::int64_t>{.name = "proximal",
                                         .member = &O::proximal,
                                         .unit = "factorisations",
                                         .doc = "of it at most",
                                         .lowest = 1,
                                         .highest = 1e9},
            OptionField<O, double>{
                .name = "near_kappa",
                .member = &O::near_kappa,
                .unit = "1",
                .doc =
                    "of that which comes before it where no interior point does, with long steps",
                .lowest = 1e-6,
                .highest = 1e12},
            OptionField<O, double>{.name = "near_easy",
                                   .member = &O::near_easy,
                                   .unit = "1",
                                   .doc = "its factor on kappa after at most 2 Newton steps",
                                   .lowest = 1,
                                   .highest = 1e3},
            OptionField<O, double>{.name = "near_hard",
                                   .member = &O::near_hard,
                                   .unit = "1",
                                   .doc = "its factor on kappa after a failure",
                                   .lowest = 1e-3,
                                   .highest = 0.999},
            OptionField<O, std::int64_t>{.name = "near_proximal",
                                         .member = &O::near_proximal,
                                         .unit = "factorisations",
                                         .doc = "of it at most",
                                         .lowest = 1,
                                         .highest = 1e9}},
        polish_fields<O>());
  }
};

struct HomotopyStage {
  static constexpr std::string_view name = "homotopy";
  static constexpr std::string_view families = InteriorPointStage::families;
  static constexpr std::string_view doc =
      "the path by its arclength, around its folds, and the proximal point from where it ends";
  double smoothing = 0.3;
  std::int64_t limit = 1500;
  std::int64_t after = 200;
  double polish = 1e-4;
  double again = 10;

  static constexpr auto fields() {
    using O = HomotopyStage;
    return std::tuple_cat(
        std::tuple{limit_field<O, std::int64_t>(&O::limit, "factorisations", "on the path at most"),
                   OptionField<O, double>{.name = "smoothing",
                                          .member = &O::smoothing,
                                          .unit = "1",
                                          .doc = "width of the smoothed kink: another is another "
                                                 "path",
                                          .lowest = 0},
                   OptionField<O, std::int64_t>{.name = "after",
                                                .member = &O::after,
                                                .unit = "factorisations",
                                                .doc = "of the proximal point from the path's end",
                                                .lowest = 0,
                                                .highest = 1e9}},
        polish_fields<O>());
  }
};

/// Where all paths from where the others begin lead elsewhere, as with friction so high that
/// contacts wedge each other.
struct PivotingStage {
  static constexpr std::string_view name = "pivoting";
  static constexpr std::string_view families = "pivoting";
  static constexpr std::string_view doc =
      "Lemke's method on polygons of friction, from several covering vectors, each end polished";
  std::int64_t tries = 60;
  std::int64_t edges = 4;
  std::int64_t pivots = 1000;
  std::int64_t polish = 100;
  double rounding = 1;

  static constexpr auto fields() {
    using O = PivotingStage;
    return std::tuple{
        OptionField<O, std::int64_t>{.name = "tries",
                                     .member = &O::tries,
                                     .unit = "covering vectors",
                                     .doc = "at most: of ones, then random ones",
                                     .lowest = 1,
                                     .highest = 1e6},
        OptionField<O, std::int64_t>{.name = "edges",
                                     .member = &O::edges,
                                     .unit = "edges",
                                     .doc = "of a polygon of friction in space",
                                     .lowest = 3,
                                     .highest = 64},
        OptionField<O, std::int64_t>{.name = "pivots",
                                     .member = &O::pivots,
                                     .unit = "pivots",
                                     .doc = "of a try at most",
                                     .lowest = 1,
                                     .highest = 1e6},
        OptionField<O, std::int64_t>{.name = "polish",
                                     .member = &O::polish,
                                     .unit = "factorisations",
                                     .doc = "of the proximal point from where a try ends",
                                     .lowest = 0,
                                     .highest = 1e6},
        OptionField<O, double>{.name = "rounding",
                               .member = &O::rounding,
                               .unit = "tolerance",
                               .doc = "of velocities up to which an end is polished: on a ray "
                                      "reactions have no bound",
                               .lowest = 0}};
  }
};

/// Newton's method has many basins where contacts wedge each other.
struct RandomStartsStage {
  static constexpr std::string_view name = "random_starts";
  static constexpr std::string_view families = "newton";
  static constexpr std::string_view doc =
      "semismooth Newton on the natural map, and a polish, from random reactions";
  std::int64_t tries = 200;
  std::int64_t limit = 60;
  std::int64_t sweeps = 5;
  std::int64_t polish = 24;

  static constexpr auto fields() {
    using O = RandomStartsStage;
    return std::tuple{
        OptionField<O, std::int64_t>{.name = "tries",
                                     .member = &O::tries,
                                     .unit = "starts",
                                     .doc = "at most",
                                     .lowest = 1,
                                     .highest = 1e6},
        limit_field<O, std::int64_t>(&O::limit, "iterations", "of Newton from each at most"),
        OptionField<O, std::int64_t>{.name = "sweeps",
                                     .member = &O::sweeps,
                                     .unit = "sweeps",
                                     .doc = "of Gauss-Seidel where Newton stands still, then "
                                            "twice as many",
                                     .lowest = 0,
                                     .highest = 1e6},
        OptionField<O, std::int64_t>{.name = "polish",
                                     .member = &O::polish,
                                     .unit = "factorisations",
                                     .doc = "of the proximal point from each",
                                     .lowest = 0,
                                     .highest = 1e6}};
  }
};

using Method =
    std::variant<GaussSeidelStage, SweepOnStage, SpectralGradientStage, ConjugateGradientsStage,
                 NewtonStage, PolishStage, ProximalStage, InteriorPointStage, AssociatedStage,
                 NoSolutionStage, HeldBodiesStage, HomotopyStage, PivotingStage, RandomStartsStage>;

struct StageRule {
  std::string name;
  When when;
  Method method;
};

using Table = std::vector<StageRule>;

/// Whether a method takes Coulomb's cone alone.
inline bool coulomb_alone(const Method& method) {
  return std::holds_alternative<AssociatedStage>(method) ||
         std::holds_alternative<HeldBodiesStage>(method);
}

/// The chain that a text describes. Throws Error (option), which names the stage and its line.
Table parse_table(std::string_view text);

}  // namespace fclib::chain
