// New places for the entries of a problem or of a solution. Each length that fields share (n, m, p,
// nc) has a map from the old number of an entry to the new one. The fields say which side follows
// which map, so that no conversion names them.
#pragma once

#include <numeric>
#include <vector>

#include "field.hpp"
#include "linalg/matrix.hpp"

namespace fclib {

/// Entry k becomes entry to[k] of `count`. No two go to one place. A place that no entry takes is
/// 0.
struct Places {
  std::vector<Index> to;
  Index count = 0;

  static Places unchanged(Index count) {
    Places places{.to = std::vector<Index>(static_cast<std::size_t>(count)), .count = count};
    std::iota(places.to.begin(), places.to.end(), 0);
    return places;
  }
};

/// Places for every length.
struct Arrangement {
  Places n, m, p, nc;

  /// All as it is in a problem.
  template <class P>
  static Arrangement of(const P& problem) {
    const auto unchanged = [&](Dim dim) { return Places::unchanged(problem.size(dim)); };
    return {unchanged(Dim::n), unchanged(Dim::m), unchanged(Dim::p), unchanged(Dim::nc)};
  }

  [[nodiscard]] const Places& places(Dim dim) const {
    switch (dim) {
      case Dim::n:
        return n;
      case Dim::m:
        return m;
      case Dim::p:
        return p;
      default:
        return nc;
    }
  }
};

/// The entries in their new places, in the same storage. What was known of the matrix is dropped.
Matrix arranged(const Matrix& a, const Places& rows, const Places& cols);
Vector arranged(const Vector& x, const Places& places);
/// Entry k is x[to[k]]: this undoes `arranged`.
Vector gathered(const Vector& x, const Places& places);

/// All fields of a problem or of a solution in their new places. Absent members stay absent.
template <class Struct>
Struct arranged(Struct value, const Arrangement& arrangement) {
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    Member& member = value.*field.member;
    if constexpr (std::same_as<Member, Matrix>) {
      if (member.empty()) return;
      member = arranged(member, arrangement.places(field.rows), arrangement.places(field.cols));
    } else if constexpr (std::same_as<Member, Vector>) {
      if (field.presence != Presence::required && member.size() == 0) return;
      member = arranged(member, arrangement.places(field.rows));
    }
  });
  return value;
}

/// A solution with the entries where they were before `arranged`.
template <class Struct>
Struct gathered(Struct value, const Arrangement& arrangement) {
  for_each_field<Struct>([&](const Field<Struct, Vector>& field) {
    Vector& member = value.*field.member;
    if (field.presence != Presence::required && member.size() == 0) return;
    member = gathered(member, arrangement.places(field.rows));
  });
  return value;
}

}  // namespace fclib
