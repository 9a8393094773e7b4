#include "convert/islands.hpp"

namespace fclib {

std::vector<Arrangement> places_of(const Islands& islands) {
  std::vector<Arrangement> result(static_cast<std::size_t>(islands.count));
  for (Arrangement& island : result) {
    island.n.count = islands.size(Dim::n);
    island.m.count = islands.size(Dim::m);
    island.p.count = islands.size(Dim::p);
    island.nc.count = islands.size(Dim::nc);
  }
  for (Index k = 0; k < islands.size(Dim::nc); ++k) {
    Arrangement& island = result[islands.contact[k]];
    island.nc.to.push_back(k);
    for (Index c = 0; c < islands.spacedim; ++c) island.m.to.push_back(islands.spacedim * k + c);
  }
  for (Index k = 0; k < islands.size(Dim::n); ++k) result[islands.dof[k]].n.to.push_back(k);
  for (Index k = 0; k < islands.size(Dim::p); ++k) result[islands.bilateral[k]].p.to.push_back(k);
  return result;
}

}  // namespace fclib
