// How good a solution is, judged from the data of the problem alone.
//
// The natural map (Acary, Bremond, Huber 2018) is F^a = r^a - P_K(r^a - u^^a) for each contact a,
// and error = ||F||_2 / ||q||_2. The scaled error is the same with rho u^, summed as impulses and
// as velocities; it does not change with the units. u is recomputed as W r + V lambda + q, or H^T v
// + w, and never taken from the solution. All sums are made in extended precision. The rounding of
// q, from the sizes of its terms, is no error, and errors are never relative to less than it.
//
// The other equations are judged by components (merit/equations.hpp). docs/mathematics.md has the
// definitions with their reasons.
#pragma once

#include <string_view>
#include <tuple>
#include <vector>

#include "contact/cone.hpp"
#include "error_size.hpp"
#include "merit/equations.hpp"
#include "merit_kind.hpp"
#include "problem.hpp"

namespace fclib {

struct Merit {
  double error = 0;
  double natural = 0;
  double scaled_natural = 0;
  double dynamics = 0;
  double bilateral = 0;
  double kinematics = 0;
  double cone = 0;
  double dual_cone = 0;
  double complementarity = 0;
  Index open = 0;
  Index stick = 0;
  Index slide = 0;

  /// `error`, or the error without the scaled map.
  [[nodiscard]] double error_by(MeritKind kind) const {
    return kind == MeritKind::both ? error_size(error)
                                   : larger_error(natural, dynamics, bilateral, kinematics);
  }

  static constexpr auto fields() {
    using M = Merit;
    return std::tuple{
        Field<M, double>{.name = "error",
                         .member = &M::error,
                         .doc = "what a tolerance bounds: the largest of natural, scaled_natural, "
                                "dynamics, bilateral and kinematics"},
        Field<M, double>{.name = "natural",
                         .member = &M::natural,
                         .doc = "||r - P_K(r - u^)|| / ||q||, q condensed for a global problem, "
                                "beyond rounding"},
        Field<M, double>{.name = "scaled_natural",
                         .member = &M::scaled_natural,
                         .doc = "F = r - P_K(r - rho u^), rho = 1 / mean abs(W_kk): the larger of "
                                "||F|| / ||rho q|| and of max(||F|| / rho, -u_N) of each contact "
                                "over ||q||: the same in all units"},
        Field<M, double>{.name = "dynamics",
                         .member = &M::dynamics,
                         .doc =
                             "largest error of a component of v, M^-1 (M v - H r - G lambda - f) "
                             "beyond rounding, over its own velocity"},
        Field<M, double>{.name = "bilateral",
                         .member = &M::bilateral,
                         .doc = "largest component of G^T v + b or V^T r + R lambda + s beyond "
                                "rounding, over the velocities of its joint"},
        Field<M, double>{.name = "kinematics",
                         .member = &M::kinematics,
                         .doc = "largest difference of a component of the solution's u from the "
                                "recomputed one beyond rounding, over the velocities of its "
                                "contact"},
        Field<M, double>{.name = "cone",
                         .member = &M::cone,
                         .unit = "N s",
                         .doc = "largest distance of a contact's r from K"},
        Field<M, double>{.name = "dual_cone",
                         .member = &M::dual_cone,
                         .unit = "m/s",
                         .doc = "largest distance of a contact's u^ from K*"},
        Field<M, double>{.name = "complementarity",
                         .member = &M::complementarity,
                         .unit = "J",
                         .doc = "largest |r . u^| of a contact"},
        Field<M, Index>{
            .name = "open", .member = &M::open, .unit = "1", .doc = "contacts without a reaction"},
        Field<M, Index>{.name = "stick",
                        .member = &M::stick,
                        .unit = "1",
                        .doc = "contacts whose reaction is inside the cone"},
        Field<M, Index>{.name = "slide",
                        .member = &M::slide,
                        .unit = "1",
                        .doc = "contacts whose reaction is on the boundary of the cone"},
    };
  }
};

/// The same for each contact, and where the equations fail most.
struct ContactMerits {
  std::vector<ContactStatus> status;
  Vector u;                          ///< velocity, recomputed (m) [m/s]
  Vector natural;                    ///< ||r - P_K(r - u^)|| (nc), absolute
  Vector cone;                       ///< distance of r from K (nc) [N s]
  Vector dual_cone;                  ///< distance of u^ from K* (nc) [m/s]
  std::vector<Mismatch> mismatches;  ///< the worst component of each of v, u and l that is stored
};

/// The merit of (solution, problem). r is required; l is required if there are bilateral
/// constraints. If v is missing, it follows from them. If u is missing, it is not judged.
///
/// Throws Error (problem) if the problem or the solution is not valid, (unsuitable) if M is
/// singular.
template <class P>
Merit merit(const P& problem, const Solution& solution);

/// The error that a tolerance bounds, for a valid problem and a valid solution, in a loop: the
/// caller gives what depends on the problem alone. u is not judged: it is replaced by the one that
/// follows.
double judge_and_complete(const LocalProblem& problem, const Friction& friction,
                          const OwnSizes& own, MeritKind kind, Solution& solution);
double judge_and_complete(const GlobalProblem& problem, const Friction& friction,
                          const Factorization& mass, const OwnSizes& own, MeritKind kind,
                          Solution& solution);

/// Like merit(); it throws the same errors.
template <class P>
ContactMerits contact_merits(const P& problem, const Solution& solution);

#define FCLIB_DECLARE(P)                                     \
  extern template Merit merit<P>(const P&, const Solution&); \
  extern template ContactMerits contact_merits<P>(const P&, const Solution&);
FCLIB_FOR_EACH_FORMULATION(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
