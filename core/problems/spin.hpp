// Spin friction: the local and the global problem with contacts that resist the turning about their
// normal. A contact has the components N, T1, T2, S (spacedim 4), or N, T1, T2, S, R1, R2 (6) if it
// resists rolling too:
//
//   K = { ||r_T|| <= mu r_N, |r_S| <= mu_s r_N, ||r_R|| <= mu_r r_N }
//   u^_N = u_N + mu ||u_T|| + mu_s |u_S| + mu_r ||u_R||
//
// or, if sliding and spin are coupled (spacedim 4),
//
//   K = { (||r_T|| / mu)^2 + (r_S / mu_s)^2 <= r_N^2 }
//   u^_N = u_N + sqrt((mu ||u_T||)^2 + (mu_s u_S)^2)
//
// r_S and r_R are angular impulses, u_S and u_R relative angular velocities.
//
// Leine & Glocker, "A set-valued force law for spatial Coulomb-Contensou friction" (2003); Todorov,
// "Convex and analytically-invertible dynamics with contacts and constraints" (2014).
#pragma once

#include "problems/global.hpp"
#include "problems/local.hpp"

namespace fclib {

/// Form is LocalProblem or GlobalProblem, Self what is made of it.
template <class Form, class Self>
struct WithSpin : Form {
  static constexpr bool spin = true;
  static constexpr std::array<Index, 2> dimensions{4, 6};

  Vector mu_s;
  Vector mu_r;
  Index coupled = 0;

  template <class P = Self>
  static constexpr auto fields() {
    return std::tuple_cat(
        Form::template fields<P>(),
        std::tuple{Field<P, Vector>{.name = "mu_s",
                                    .member = &P::mu_s,
                                    .rows = Dim::nc,
                                    .unit = "m",
                                    .doc = "coefficient of spin friction",
                                    .range = Range::nonnegative},
                   Field<P, Vector>{.name = "mu_r",
                                    .member = &P::mu_r,
                                    .rows = Dim::nr,
                                    .presence = Presence::optional,
                                    .unit = "m",
                                    .doc = "coefficient of rolling friction, if spacedim is 6",
                                    .range = Range::nonnegative},
                   Field<P, Index>{.name = "coupled",
                                   .member = &P::coupled,
                                   .unit = "1",
                                   .doc = "1: sliding and spin share one limit, an ellipsoid; 0: "
                                          "each has its own"}});
  }

  [[nodiscard]] Index size(Dim dim) const {
    if (dim == Dim::nr) return this->spacedim == 6 ? Form::size(Dim::nc) : 0;
    return Form::size(dim);
  }
};

struct LocalSpinProblem : WithSpin<LocalProblem, LocalSpinProblem> {
  static constexpr std::string_view kind = "local_spin";  // the group /fclib_local_spin
  static constexpr const char* doc =
      "The local problem with spin friction: u = W r + q (+ V lambda).";
  static constexpr std::string_view prefix = "S";  // of the formulation's name
};

struct GlobalSpinProblem : WithSpin<GlobalProblem, GlobalSpinProblem> {
  static constexpr std::string_view kind = "global_spin";  // the group /fclib_global_spin
  static constexpr const char* doc =
      "The global problem with spin friction: M v = H r + f (+ G lambda), u = H^T v + w.";
  static constexpr std::string_view prefix = "GS";  // of the formulation's name
};

}  // namespace fclib
