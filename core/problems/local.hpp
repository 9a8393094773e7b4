// The local problem: contact velocities and reactions alone.
//
//   3DFC (W, q, mu)             u = W r + q
//   M3DFC (W, V, R, q, s, mu)   u = W r + V lambda + q,   V^T r + R lambda + s = 0
//
// and for each contact, with u^ = u + [mu ||u_T||, 0, 0],
//
//   K* contains u^,   u^ . r = 0,   r in K = { ||r_T|| <= mu r_N }.
//
// W (m x m) is the Delassus matrix, m = d nc; component 0 of a contact is normal, the others
// tangential. d = 2 is the planar case.
//
// Acary, Bremond, Koziara, Perignon, "FCLIB: a collection of discrete 3D Frictional Contact
// problems", INRIA RT-0444 (2014), sections 2.2 and 2.3.
#pragma once

#include <array>
#include <tuple>

#include "field.hpp"
#include "geometry.hpp"
#include "linalg/matrix.hpp"
#include "problem_info.hpp"

namespace fclib {

struct LocalProblem {
  static constexpr std::string_view kind = "local";  // the group /fclib_local
  static constexpr const char* doc =
      "The local problem: u = W r + q (+ V lambda), Coulomb's law at each contact.";
  static constexpr std::string_view prefix = "";   // of the formulation's name
  static constexpr bool triplets_on_disk = false;  // W keeps its storage

  static constexpr bool rolling = false;
  static constexpr bool spin = false;
  static constexpr std::array<Index, 2> dimensions{2, 3};  // the spacedims there are

  Index spacedim = 3;
  Matrix W;
  Matrix V;
  Matrix R;
  Vector q;
  Vector mu;
  Vector s;
  ProblemInfo info;
  GeometryPointer geometry;

  /// `P` is this struct, or one derived from it.
  template <class P = LocalProblem>
  static constexpr auto fields() {
    return std::tuple{
        Field<P, Index>{.name = "spacedim",
                        .member = &P::spacedim,
                        .unit = "1",
                        .doc = "components of a contact: 2 (planar) or 3; 3 or 5 with rolling, 4 "
                               "or 6 with spin"},
        Field<P, Matrix>{.name = "W",
                         .member = &P::W,
                         .rows = Dim::m,
                         .cols = Dim::m,
                         .unit = "1/kg",
                         .doc = "Delassus matrix, positive semi-definite"},
        Field<P, Matrix>{.name = "V",
                         .member = &P::V,
                         .rows = Dim::m,
                         .cols = Dim::p,
                         .presence = Presence::mixed,
                         .unit = "1/kg",
                         .doc = "velocity of the contacts under the bilateral multipliers"},
        Field<P, Matrix>{.name = "R",
                         .member = &P::R,
                         .rows = Dim::p,
                         .cols = Dim::p,
                         .presence = Presence::mixed,
                         .unit = "1/kg",
                         .doc = "Delassus matrix of the bilateral constraints"},
        Field<P, Vector>{.name = "q",
                         .member = &P::q,
                         .rows = Dim::m,
                         .unit = "m/s",
                         .doc = "velocity of the contacts without reactions"},
        Field<P, Vector>{.name = "mu",
                         .member = &P::mu,
                         .rows = Dim::nc,
                         .unit = "1",
                         .doc = "coefficient of friction of each contact",
                         .range = Range::nonnegative},
        Field<P, Vector>{.name = "s",
                         .member = &P::s,
                         .rows = Dim::p,
                         .presence = Presence::mixed,
                         .unit = "m/s",
                         .doc = "velocity of the bilateral constraints without reactions"},
    };
  }

  [[nodiscard]] Index size(Dim dim) const {
    switch (dim) {
      case Dim::one:
        return 1;
      case Dim::n:
        return 0;
      case Dim::m:
        return spacedim * static_cast<Index>(mu.size());
      case Dim::p:
        return R.rows;
      case Dim::nc:
        return static_cast<Index>(mu.size());
      case Dim::nr:
        return 0;
    }
    return 0;
  }
};

}  // namespace fclib
