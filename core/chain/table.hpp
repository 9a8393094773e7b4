// A chain of methods as data: which stages there are, when each runs, what it starts from and what
// it may cost. `auto` is one such table (solvers/automatic.cpp). A user may give another.
//
// In text, each line is a stage (";" also ends one), and "#" begins a comment:
//
//   NAME : METHOD key=value ...
//
// NAME is what results call the stage. METHOD is one of the structs below. The keys of `When` say
// when the stage runs; the other keys belong to the method. What no table sets is a constant beside
// its method.
//
// The cost of a stage is counted in its own steps or in operations, never in time. So the same
// problem takes the same path on every machine.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <variant>
#include <vector>

#include "contact/contact_functions.hpp"
#include "methods/held_bodies.hpp"
#include "methods/interior_point.hpp"
#include "methods/proximal_point.hpp"
#include "methods/semismooth_newton.hpp"
#include "solve/options.hpp"

namespace fclib::chain {

// ---- when a stage runs

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
  double range = 0;
  Bodies bodies = Bodies::any;
  Law law = Law::any;

  static constexpr auto fields() {
    using O = When;
    return std::tuple{
        choice("on", &O::on, on_names,
               "What the stage works on: all contacts at once, or each island of contacts that W "
               "links, if it is not solved yet."),
        option("at_least", &O::at_least, "contacts", {0}, "The smallest number of contacts."),
        option("at_most", &O::at_most, "contacts", {0},
               "The largest number of contacts. 0: any number."),
        option("below", &O::below, "1", {0},
               "The stage runs only if the error is below this. 0: always."),
        flag("guessed", &O::guessed, "The stage runs only if there is a guess."),
        option("jointed", &O::jointed, "1", {0, 1},
               "The stage runs only if bilateral constraints take more than this share of the "
               "mobility of some contact. 0: always."),
        option("range", &O::range, "1", {0},
               "The stage runs only if the largest trace of a diagonal block of W is more than so "
               "many times the least one. 0: always."),
        choice("bodies", &O::bodies, bodies_names,
               "fewer: the bodies have at most half as many coordinates as the contacts. more: "
               "they have more."),
        choice("law", &O::law, law_names,
               "The contacts that the stage takes: those of Coulomb's law, those with rolling "
               "friction, or both."),
    };
  }
};

// ---- what it starts from

enum class Start { nothing, best, swept, associated };
inline constexpr std::array<std::string_view, 4> start_names{"nothing", "best", "swept",
                                                             "associated"};
inline constexpr std::string_view start_doc =
    "What the stage starts from. nothing: r = 0. best: the best iterate so far. swept: the best "
    "one "
    "as the chain came to the first stage that starts from swept or associated. associated: an "
    "iterate of the associated problem; swept if there is none.";

template <class Struct>
constexpr auto start_from(Start Struct::* member) {
  return choice("from", member, start_names, start_doc);
}

/// An error without a limit. From an iterate that is nearly a solution, the way to the solution may
/// lead over errors that are far larger.
inline constexpr double endless = std::numeric_limits<double>::infinity();

// ---- the methods

/// Sweeps over the contacts, from the iterate that the whole or the island started with.
struct GaussSeidelStage {
  static constexpr std::string_view name = "gauss_seidel";
  static constexpr std::string_view families = "splitting";
  static constexpr std::string_view doc = "Sweeps of nonsmooth Gauss-Seidel.";
  std::int64_t limit = 100;
  std::int64_t left = 0;
  double worth = 3;

  static constexpr auto fields() {
    using O = GaussSeidelStage;
    return std::tuple{
        option(
            "limit", &O::limit, "sweeps", {1, 1e9},
            "The largest number of sweeps. With left or worth, the sweeps go on instead while an "
            "end is in sight: at the rate of their second half, at most left sweeps are left (20 "
            "times limit if left is 0). They end if none was in sight for half of them."),
        option("left", &O::left, "sweeps", {0, 1e9},
               "The largest number of sweeps that may be left, at their rate. 0: any number."),
        option("worth", &O::worth, "factorisations a digit", {0},
               "What the sweeps that are left, at their rate, may cost for each digit of the "
               "tolerance. 0: anything.")};
  }
};

/// How long a method goes on if its steps are cheap and converge slowly.
struct Patience {
  double worth = 0;
  std::int64_t first_look = 50;

  static constexpr auto fields() {
    using O = Patience;
    return std::tuple{
        option("worth", &O::worth, "factorisations", {0},
               "What all steps may cost. If that does not pay for twice the first look, the stage "
               "is left out. 0: what the chain has spent on factorisations."),
        option("first_look", &O::first_look, "steps", {1, 1e6},
               "The number of steps before the first look at the rate. The next looks come after "
               "twice as many.")};
  }
};

/// Sweeps from the best iterate. If the tolerance is loose, they often succeed when interior points
/// fail, or long before one factorisation is done.
struct SweepOnStage : Patience {
  static constexpr std::string_view name = "sweep_on";
  static constexpr std::string_view families = "splitting";
  static constexpr std::string_view doc =
      "Sweeps from the best iterate, as long as they may end for what factorisations cost.";
};

/// For many contacts in a dense W: one factorisation costs as much as thousands of products with W.
struct SpectralGradientStage : Patience {
  static constexpr std::string_view name = "spectral_gradient";
  static constexpr std::string_view families = "optimisation";
  static constexpr std::string_view doc =
      "Spectral projected gradients, as long as they may end for what factorisations cost.";
  Start from = Start::best;

  static constexpr auto fields() {
    return std::tuple_cat(std::tuple{start_from(&SpectralGradientStage::from)}, Patience::fields());
  }
};

/// For many bodies at rest: one factorisation serves many steps.
struct AlternatingDirectionsStage : Patience {
  static constexpr std::string_view name = "alternating_directions";
  static constexpr std::string_view families = "optimisation";
  static constexpr std::string_view doc =
      "ADMM with de Saxce's term in the loop, as long as it may end for what factorisations cost.";
};

/// On W r = -q, preconditioned by tr(W_aa). It starts from the guess, or from r = 0.
struct ConjugateGradientsStage {
  static constexpr std::string_view name = "conjugate_gradients";
  static constexpr std::string_view families = "krylov";
  static constexpr std::string_view doc =
      "Conjugate gradients on W r = -q: all may stick and rest. They end if r leaves the cones.";
  std::int64_t limit = 400;

  static constexpr auto fields() {
    return std::tuple{
        option("limit", &ConjugateGradientsStage::limit, "iterations", {1, 1e9},
               "The largest number of iterations. The stage ends early if more are needed.")};
  }
};

inline constexpr std::array<std::string_view, 4> function_names{
    "alart_curnier", "jean_moreau", "natural_map", "fischer_burmeister"};

struct NewtonStage : NewtonRules {
  static constexpr std::string_view name = "semismooth_newton";
  static constexpr std::string_view families = "newton";
  static constexpr std::string_view doc = "Semismooth Newton, always on the contacts.";
  Start from = Start::nothing;
  ContactFunctionKind function = ContactFunctionKind::natural_map;
  std::int64_t limit = 200;
  double most_flops = 0;

  static constexpr auto fields() {
    using O = NewtonStage;
    return std::tuple{
        start_from(&O::from),
        option("limit", &O::limit, "iterations", {1, 1e9}, "The largest number of iterations."),
        choice("function", &O::function, function_names, "The function whose zero is sought."),
        option("sweeps", &O::sweeps, "sweeps", {0, 1e6},
               "The number of sweeps of Gauss-Seidel if Newton stands still; then twice as many."),
        option("patience", &O::patience, "iterations", {1, 1e6},
               "The number of iterations in which the error must halve."),
        option("most_flops", &O::most_flops, "1", {0},
               "The stage is left out if its factorisation takes so many times the operations of "
               "that of the other methods. 0: never."),
    };
  }
};

/// The proximal point. Each of the methods below has its own rule for the step.
struct ProximalStageRules : ProximalRules {
  Start from = Start::best;
  bool wander = false;

  static constexpr auto fields() {
    using O = ProximalStageRules;
    return std::tuple{
        start_from(&O::from),
        option("limit", &O::max_factorisations, "factorisations", {1, 1e9},
               "The largest number of factorisations."),
        flag("wander", &O::wander, "The stage goes on from any error, however large."),
    };
  }
};

/// For contacts whose statuses are nearly known.
struct PolishStage : ProximalStageRules {
  static constexpr std::string_view name = "polish";
  static constexpr std::string_view families = "newton, proximal point";
  static constexpr std::string_view doc =
      "The proximal point with long steps, for the last digits. Other stages polish with it.";

  PolishStage() {
    kappa = 1000;
    easy = 10;
    hard = 0.2;
    max_factorisations = 24;
  }
};

struct ProximalStage : ProximalStageRules {
  static constexpr std::string_view name = "proximal_point";
  static constexpr std::string_view families = "newton, proximal point";
  static constexpr std::string_view doc = "The proximal point with an accurate inner solution.";

  ProximalStage() {
    kappa = 10;
    max_factorisations = 200;
  }
};

struct InteriorPointStage : InteriorPointRules {
  static constexpr std::string_view name = "interior_point";
  // the proximal point polishes what it reaches
  static constexpr std::string_view families = "interior point, newton, proximal point";
  static constexpr std::string_view doc =
      "The interior point with de Saxce's term in Newton's system. It is polished as it comes "
      "near. "
      "Rolling contacts have no smoothing.";
  Start from = Start::swept;
  double far = 0;
  double polish = 1e-5;

  static constexpr auto fields() {
    using O = InteriorPointStage;
    return std::tuple{
        start_from(&O::from),
        option("limit", &O::max_iterations, "iterations", {1, 1e9},
               "The largest number of iterations."),
        tau_option(),
        option("far", &O::far, "1", {0},
               "The complementarity at first, over the error of the start. It is between tau and "
               "1. 0: tau."),
        smoothing_option(),
        step_cap_option(),
        delta_option(),
        option("polish", &O::polish, "1", {0},
               "Iterates of a smaller error are polished; those of rolling contacts at ten times "
               "the error.")};
  }
};

/// If the velocity of the associated problem tends to zero, its reactions solve this problem too.
struct AssociatedStage {
  static constexpr std::string_view name = "associated";
  static constexpr std::string_view families = InteriorPointStage::families;
  static constexpr std::string_view doc =
      "The interior point on the convex problem. It ends if its velocity does not tend to zero.";

  static constexpr auto fields() { return std::tuple{}; }
};

/// The frictionless problem is convex. Its proximal point iterates converge if there is a solution.
/// If there is none, they go to infinity along a ray, and the ray is the proof (Pazy 1971).
struct NoSolutionStage {
  static constexpr std::string_view name = "no_solution";
  static constexpr std::string_view families = "newton, proximal point";
  static constexpr std::string_view doc =
      "A proof by Farkas' lemma that there is no solution. The data as given must confirm it.";
  std::int64_t limit = 60;

  static constexpr auto fields() {
    return std::tuple{option("limit", &NoSolutionStage::limit, "factorisations", {1, 1e9},
                             "The largest number of factorisations.")};
  }
};

/// For problems in which most bodies rest and many different reactions hold them.
struct HeldBodiesStage : HeldBodiesRules {
  static constexpr std::string_view name = "held_bodies";
  static constexpr std::string_view families = InteriorPointStage::families;
  static constexpr std::string_view doc =
      "A convex problem on the whole and Coulomb's law on the bodies that move in it, in turn. It "
      "takes problems that are known by their bodies.";
};

struct HomotopyStage {
  static constexpr std::string_view name = "homotopy";
  static constexpr std::string_view families = InteriorPointStage::families;
  static constexpr std::string_view doc =
      "The path by its arclength, around its folds, and the proximal point from where it ends.";
  double smoothing = 0.3;
  std::int64_t limit = 1500;

  static constexpr auto fields() {
    using O = HomotopyStage;
    return std::tuple{option("limit", &O::limit, "factorisations", {1, 1e9},
                             "The largest number of factorisations on the path."),
                      option("smoothing", &O::smoothing, "1", {0},
                             "The width of the smoothed kink. Another width is another path.")};
  }
};

/// For problems in which all paths from the usual starts lead to no solution, for example if
/// friction is so high that contacts wedge each other.
struct PivotingStage {
  static constexpr std::string_view name = "pivoting";
  static constexpr std::string_view families = "pivoting";
  static constexpr std::string_view doc =
      "Lemke's method on polygons of friction, from several covering vectors. Each end is "
      "polished.";
  std::int64_t tries = 60;
  std::int64_t edges = 4;

  static constexpr auto fields() {
    using O = PivotingStage;
    return std::tuple{
        option("tries", &O::tries, "covering vectors", {1, 1e6},
               "The largest number of covering vectors: one of ones, then random ones."),
        option("edges", &O::edges, "edges", {3, 64},
               "The number of edges of a polygon of friction in space.")};
  }
};

/// If contacts wedge each other, Newton's method has many basins of attraction.
struct RandomStartsStage {
  static constexpr std::string_view name = "random_starts";
  static constexpr std::string_view families = "newton";
  static constexpr std::string_view doc =
      "Semismooth Newton on the natural map, and a polish, from random reactions.";
  std::int64_t tries = 200;

  static constexpr auto fields() {
    return std::tuple{option("tries", &RandomStartsStage::tries, "starts", {1, 1e6},
                             "The largest number of starts.")};
  }
};

/// If some bodies are very much lighter than others, or lengths stand beside angles, sweeps and
/// factors of W lose digits on what is small. In its own units (reduced/own_units.hpp) all diagonal
/// blocks of W are about 1.
struct OwnUnitsStage {
  static constexpr std::string_view name = "own_units";
  static constexpr std::string_view families = "chain";
  static constexpr std::string_view doc =
      "The stages of the table before this one, on the problem in the units of its contacts.";
  Start from = Start::nothing;

  static constexpr auto fields() { return std::tuple{start_from(&OwnUnitsStage::from)}; }
};

using Method =
    std::variant<GaussSeidelStage, SweepOnStage, SpectralGradientStage, ConjugateGradientsStage,
                 AlternatingDirectionsStage, NewtonStage, PolishStage, ProximalStage,
                 InteriorPointStage, AssociatedStage, NoSolutionStage, HeldBodiesStage,
                 HomotopyStage, PivotingStage, RandomStartsStage, OwnUnitsStage>;

struct StageRule {
  std::string name;
  When when;
  Method method;
};

using Table = std::vector<StageRule>;

/// The families of solvers that a method is of.
std::string_view families_of(const Method& method);
/// What a method starts from; nothing if its table does not choose that.
std::optional<Start> chosen_start(const Method& method);

/// Whether a method takes only Coulomb's cone.
inline bool coulomb_alone(const Method& method) {
  return std::holds_alternative<AssociatedStage>(method) ||
         std::holds_alternative<HeldBodiesStage>(method);
}

/// Whether a method factorises the system that all methods share. Newton's has its own.
inline bool factorises(const Method& method) {
  return !std::holds_alternative<NewtonStage>(method) &&
         !std::holds_alternative<GaussSeidelStage>(method) &&
         !std::holds_alternative<SweepOnStage>(method) &&
         !std::holds_alternative<SpectralGradientStage>(method) &&
         !std::holds_alternative<ConjugateGradientsStage>(method);
}

/// The chain that a text describes. Throws Error (option) that names the stage and its line.
Table parse_table(std::string_view text);

}  // namespace fclib::chain
