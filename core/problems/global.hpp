// The global problem: the dynamics of the bodies, the constraints, and the contacts.
//
//   G3DFC (M, H, f, w, mu)          M v = H r + f,              u = H^T v + w
//   GM3DFC (M, H, G, f, w, b, mu)   M v = H r + G lambda + f,   u = H^T v + w,   G^T v + b = 0
//
// and for each contact Coulomb's law between u and r, as in the local problem.
//
// M (n x n) is a mass matrix, symmetric positive definite, or the matrix of an iteration, as a
// tangent, which need not be symmetric. H (n x m) maps reactions to generalised forces, m = d nc;
// component 0 of a contact is normal, the others tangential. d = 2 is the planar case.
//
// Acary, Bremond, Koziara, Perignon, "FCLIB: a collection of discrete 3D Frictional Contact
// problems", INRIA RT-0444 (2014), sections 2.4 and 2.5.
#pragma once

#include <array>
#include <tuple>

#include "field.hpp"
#include "geometry.hpp"
#include "linalg/matrix.hpp"
#include "problem_info.hpp"

namespace fclib {

struct GlobalProblem {
  static constexpr std::string_view kind = "global";  // the group /fclib_global
  static constexpr const char* doc =
      "The global problem: M v = H r + f (+ G lambda), u = H^T v + w, Coulomb's law.";
  static constexpr std::string_view prefix = "G";  // of the formulation's name
  static constexpr bool triplets_on_disk = true;   // the only storage that Siconos reads

  static constexpr bool rolling = false;
  static constexpr bool spin = false;
  static constexpr std::array<Index, 2> dimensions{2, 3};  // the spacedims there are

  Index spacedim = 3;
  Matrix M;
  Matrix H;
  Matrix G;
  Vector f;
  Vector w;
  Vector mu;
  Vector b;
  ProblemInfo info;
  GeometryPointer geometry;

  /// `P` is this struct, or one derived from it.
  template <class P = GlobalProblem>
  static constexpr auto fields() {
    return std::tuple{
        Field<P, Index>{.name = "spacedim",
                        .member = &P::spacedim,
                        .unit = "1",
                        .doc = "components of a contact: 2 (planar) or 3; 3 or 5 with rolling, 4 "
                               "or 6 with spin"},
        Field<P, Matrix>{
            .name = "M",
            .member = &P::M,
            .rows = Dim::n,
            .cols = Dim::n,
            .unit = "kg",
            .doc = "mass matrix, symmetric positive definite, or matrix of an iteration"},
        Field<P, Matrix>{.name = "H",
                         .member = &P::H,
                         .rows = Dim::n,
                         .cols = Dim::m,
                         .unit = "1",
                         .doc = "reactions to generalised forces; H^T takes v to u - w"},
        Field<P, Matrix>{.name = "G",
                         .member = &P::G,
                         .rows = Dim::n,
                         .cols = Dim::p,
                         .presence = Presence::mixed,
                         .unit = "1",
                         .doc = "bilateral multipliers to generalised forces"},
        Field<P, Vector>{.name = "f",
                         .member = &P::f,
                         .rows = Dim::n,
                         .unit = "N s",
                         .doc = "momentum without reactions"},
        Field<P, Vector>{.name = "w",
                         .member = &P::w,
                         .rows = Dim::m,
                         .unit = "m/s",
                         .doc = "prescribed part of the contact velocity (impact law, motion)"},
        Field<P, Vector>{.name = "mu",
                         .member = &P::mu,
                         .rows = Dim::nc,
                         .unit = "1",
                         .doc = "coefficient of friction of each contact",
                         .range = Range::nonnegative},
        Field<P, Vector>{.name = "b",
                         .member = &P::b,
                         .rows = Dim::p,
                         .presence = Presence::mixed,
                         .unit = "m/s",
                         .doc = "prescribed velocity of the bilateral constraints"},
    };
  }

  [[nodiscard]] Index size(Dim dim) const {
    switch (dim) {
      case Dim::one:
        return 1;
      case Dim::n:
        return M.rows;
      case Dim::m:
        return spacedim * static_cast<Index>(mu.size());
      case Dim::p:
        return G.cols;
      case Dim::nc:
        return static_cast<Index>(mu.size());
      case Dim::nr:
        return 0;
    }
    return 0;
  }
};

}  // namespace fclib
