// Rolling friction: the local and the global problem with
//
//   K = { ||r_T|| <= mu r_N, ||r_R|| <= mu_r r_N },   u^_N = u_N + mu ||u_T|| + mu_r ||u_R||.
//
// A contact has the components N, T1, T2, R1, R2 (spacedim 5), or N, T, R in the plane (3); r_R are
// angular impulses, u_R relative angular velocities.
//
// Acary & Bourrier, "Coulomb friction with rolling resistance as a cone complementarity problem"
// (2021).
#pragma once

#include "problems/global.hpp"
#include "problems/local.hpp"

namespace fclib {

/// Form is LocalProblem or GlobalProblem, Self what is made of it.
template <class Form, class Self>
struct WithRolling : Form {
  static constexpr bool rolling = true;
  static constexpr std::array<Index, 2> dimensions{3, 5};

  Vector mu_r;

  template <class P = Self>
  static constexpr auto fields() {
    return std::tuple_cat(Form::template fields<P>(),
                          std::tuple{Field<P, Vector>{.name = "mu_r",
                                                      .member = &P::mu_r,
                                                      .rows = Dim::nc,
                                                      .unit = "m",
                                                      .doc = "coefficient of rolling friction",
                                                      .range = Range::nonnegative}});
  }
};

struct LocalRollingProblem : WithRolling<LocalProblem, LocalRollingProblem> {
  static constexpr std::string_view kind = "local_rolling";  // the group /fclib_local_rolling
  static constexpr const char* doc =
      "The local problem with rolling friction: u = W r + q (+ V lambda).";
  static constexpr std::string_view prefix = "R";  // of the formulation's name
};

struct GlobalRollingProblem : WithRolling<GlobalProblem, GlobalRollingProblem> {
  static constexpr std::string_view kind = "global_rolling";  // the group /fclib_global_rolling
  static constexpr const char* doc =
      "The global problem with rolling friction: M v = H r + f (+ G lambda), u = H^T v + w.";
  static constexpr std::string_view prefix = "GR";  // of the formulation's name
};

}  // namespace fclib
