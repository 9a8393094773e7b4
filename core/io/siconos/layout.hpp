// The formulations as the format tells them apart, and its numbers.
#pragma once

#include <array>
#include <concepts>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "io/siconos/words.hpp"
#include "problem.hpp"

namespace fclib::siconos {

constexpr Count largest_index = std::numeric_limits<Index>::max();

// the numbers of Siconos for its storages and for the origins of a sparse matrix
enum : Count { text_dense = 0, text_blocks = 1, text_sparse = 2 };
enum : Count { origin_triplet = 1, origin_csc = 2, origin_csr = 3 };

struct Layout {
  std::string_view kind;
  bool rolling;
  std::array<Index, 2> dimensions;
  int matrices = 0;  // 1: W, 2: M and H
};

/// Calls visit(field) for the matrices, or the vectors, that the format holds, in their order.
template <class P, class Member, class Visitor>
void for_each_stored(Visitor&& visit) {
  for_each_field<P>([&]<class Other>(const Field<P, Other>& field) {
    if constexpr (std::same_as<Other, Member>) {
      if (field.presence == Presence::required) visit(field);
    }
  });
}

std::vector<Layout> layouts();

bool has_dimension(const Layout& layout, Index d);

/// The layout of a kind, or nothing if the kind is not given.
std::optional<Layout> layout_of(std::string_view kind);

}  // namespace fclib::siconos
