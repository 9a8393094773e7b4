#include "linalg/colouring.hpp"

#include <algorithm>
#include <limits>
#include <set>

#include "linalg/with_dimension.hpp"

namespace fclib {

Colouring colour_contacts(const BlockMatrix& W, std::size_t size) {
  const auto nc = static_cast<std::size_t>(W.block_count());
  // the neighbours of each contact, itself among them; the pattern of W may be unsymmetric
  std::vector<std::vector<Index>> neighbours(nc);
  with_dimension(W.block_size(), [&](auto d) {
    W.for_each_block<d>([&](Index row, Index col, const auto&) {
      neighbours[static_cast<std::size_t>(row)].push_back(col);
      if (row != col) neighbours[static_cast<std::size_t>(col)].push_back(row);
    });
  });

  // each contact's cluster, which grows by its neighbour that comes first in the given order
  constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> cluster(nc, none);
  std::vector<std::vector<std::size_t>> members;
  for (std::size_t a = 0; a < nc; ++a) {
    if (cluster[a] != none) continue;
    members.emplace_back();
    std::set<std::size_t> frontier{a};
    while (!frontier.empty() && members.back().size() < size) {
      const std::size_t next = *frontier.begin();
      frontier.erase(frontier.begin());
      cluster[next] = members.size() - 1;
      members.back().push_back(next);
      for (const Index b : neighbours[next]) {
        if (cluster[static_cast<std::size_t>(b)] == none)
          frontier.insert(static_cast<std::size_t>(b));
      }
    }
    std::sort(members.back().begin(), members.back().end());
  }

  // the first colour that no neighbouring cluster has
  std::vector<std::size_t> colour(members.size(), none);
  std::vector<std::size_t> barred_for;  // per colour: the last cluster that it was barred for
  for (std::size_t c = 0; c < members.size(); ++c) {
    for (const std::size_t a : members[c]) {
      for (const Index b : neighbours[a]) {
        const std::size_t other = colour[cluster[static_cast<std::size_t>(b)]];
        if (other != none) barred_for[other] = c;
      }
    }
    colour[c] = static_cast<std::size_t>(std::find_if(barred_for.begin(), barred_for.end(),
                                                      [&](std::size_t last) { return last != c; }) -
                                         barred_for.begin());
    if (colour[c] == barred_for.size()) barred_for.push_back(none);
  }

  Colouring result;
  for (std::size_t k = 0; k < barred_for.size(); ++k) {
    result.colours.push_back(result.clusters.size());
    for (std::size_t c = 0; c < members.size(); ++c) {
      if (colour[c] != k) continue;
      result.clusters.push_back(result.order.size());
      for (const std::size_t a : members[c]) result.order.push_back(static_cast<Index>(a));
    }
  }
  result.colours.push_back(result.clusters.size());
  result.clusters.push_back(nc);
  return result;
}

}  // namespace fclib
