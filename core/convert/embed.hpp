// Planar problems as spatial ones: (N, T) becomes (N, T, 0), and (N, T, R) with rolling becomes
// (N, T, 0, R, 0).
//
// The new components have masses of their own, so that the spatial problem has the planar solution
// and no other in them. Each new row of W has one entry, its diagonal: the mean of the contact's
// diagonal in the planar W. A global problem gets one degree of freedom more for each new
// component. It has the mean mass and is at rest.
#pragma once

#include "convert/arrange.hpp"
#include "problem.hpp"

namespace fclib {

/// Where the entries of a planar problem stand in the spatial one.
template <class P>
Arrangement spatial_places(const P& planar) {
  const auto [d, spatial] = P::dimensions;
  if (P::spin || planar.spacedim != d) {  // nothing spins in the plane
    throw Error(ErrorKind::unsuitable,
                "is " + std::to_string(planar.spacedim) + ", the problem is not planar",
                "/" + group_name<P>() + "/spacedim");
  }
  Arrangement places = Arrangement::of(planar);
  const Index nc = planar.size(Dim::nc);
  places.m.count = spatial * nc;
  for (Index contact = 0; contact < nc; ++contact) {
    // N stays, then every second component
    for (Index k = 0; k < d; ++k) {
      places.m.to[d * contact + k] = spatial * contact + (k == 0 ? 0 : 2 * k - 1);
    }
  }
  if (planar.size(Dim::n) > 0) places.n.count += (spatial - d) * nc;
  return places;
}

/// The spatial problem of a planar one. Throws Error (unsuitable) if the problem is not planar.
template <class P>
P embed(const P& planar) {
  const auto [d, spatial] = P::dimensions;
  const Index nc = planar.size(Dim::nc);
  P result = arranged(planar, spatial_places(planar));
  result.spacedim = spatial;
  const auto add = [](Matrix& a, const auto& entries) {
    const Storage storage = a.storage;
    a = converted(a, Storage::triplet);
    for (const auto& [row, col, value] : entries) {
      a.i.push_back(row);
      a.p.push_back(col);
      a.x.push_back(value);
    }
    a = converted(a, storage);
  };
  using Entry = std::tuple<Index, Index, double>;
  std::vector<Entry> own;
  if constexpr (requires { planar.W; }) {
    Vector diagonal = Vector::Zero(nc);
    for_each_entry(planar.W, [&, d = d](Index row, Index col, double value) {
      if (row == col) diagonal[row / d] += value / d;
    });
    for (Index contact = 0; contact < nc; ++contact) {
      const double value = diagonal[contact] > 0 ? diagonal[contact] : 1;
      for (Index k = 2; k < spatial; k += 2) {
        own.emplace_back(spatial * contact + k, spatial * contact + k, value);
      }
    }
    add(result.W, own);
  } else {
    const Index n = planar.size(Dim::n);
    if (n == 0) return result;
    double trace = 0;
    for_each_entry(planar.M, [&](Index row, Index col, double value) {
      if (row == col) trace += value;
    });
    std::vector<Entry> masses;
    for (Index contact = 0; contact < nc; ++contact) {
      for (Index k = 2; k < spatial; k += 2) {
        const Index dof = n + static_cast<Index>(masses.size());
        masses.emplace_back(dof, dof, trace / n);
        own.emplace_back(dof, spatial * contact + k, 1.0);
      }
    }
    add(result.M, masses);
    add(result.H, own);
  }
  return result;
}

/// The spatial solution of a planar one, and back.
template <class P>
Solution embed(const Solution& solution, const P& planar) {
  validate(solution, planar);
  return arranged(solution, spatial_places(planar));
}
template <class P>
Solution flatten(const Solution& solution, const P& planar) {
  validate(solution, embed(planar));
  return gathered(solution, spatial_places(planar));
}

}  // namespace fclib
