// The order of the components of contacts in other tools. Ours is (N, T1, T2), one contact after
// the other, as in Siconos and in MuJoCo's elliptic cones.
//
//   normal-last  (T1, T2, N) for one contact after the other: Pinocchio, ContactBench
//   normals-first  all N, then all tangential components contact by contact: linear complementarity
//                  problems (Stewart & Trinkle 1996) and many multibody codes
//
// All of them state the law for the same u and r: only the places change, never a sign.
#pragma once

#include <string>
#include <string_view>

#include "convert/arrange.hpp"
#include "problem.hpp"

namespace fclib {

enum class ComponentOrder { normal_first, normal_last, normals_first };

/// The order of a name. Throws Error (option) if there is none.
inline ComponentOrder component_order_of(std::string_view name) {
  if (name == "normal-first") return ComponentOrder::normal_first;
  if (name == "normal-last") return ComponentOrder::normal_last;
  if (name == "normals-first") return ComponentOrder::normals_first;
  throw Error(ErrorKind::option,
              "there is no order '" + std::string(name) +
                  "'; there are: normal-first, normal-last, normals-first",
              "order");
}

/// Where each of our components stands in another order (m = d nc).
inline Places component_places(ComponentOrder order, Index nc, Index d) {
  Places places = Places::unchanged(d * nc);
  for (Index contact = 0; contact < nc; ++contact) {
    const Index first = d * contact;
    if (order == ComponentOrder::normal_last) {
      places.to[first] = first + d - 1;
      for (Index k = 1; k < d; ++k) places.to[first + k] = first + k - 1;
    } else if (order == ComponentOrder::normals_first) {
      places.to[first] = contact;
      for (Index k = 1; k < d; ++k) places.to[first + k] = nc + (d - 1) * contact + k - 1;
    }
  }
  return places;
}

/// The data of a problem in another order. It is no longer a problem of ours.
template <class P>
P to_order(const P& problem, ComponentOrder order) {
  Arrangement places = Arrangement::of(problem);
  places.m = component_places(order, problem.size(Dim::nc), problem.spacedim);
  return arranged(problem, places);
}

/// The problem whose data is in another order. The sizes must agree with each other.
template <class P>
P from_order(const P& data, ComponentOrder order) {
  Arrangement places = Arrangement::of(data);
  const Places there = component_places(order, data.size(Dim::nc), data.spacedim);
  for (std::size_t k = 0; k < there.to.size(); ++k) {
    places.m.to[there.to[k]] = static_cast<Index>(k);
  }
  return arranged(data, places);
}

}  // namespace fclib
