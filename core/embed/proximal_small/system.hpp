// How the contacts see one another: u = W x + q
//
// A system has the memory that the lanes of a group share. It offers
//
//   take      reads a problem: whether all entries are finite, q, and the mean |W_kk| of a contact
//   product   y = W x of the lane's contacts
//   put       F and D of a contact
//   solve     the Newton step dp of the lane's contacts, after `put` of all
//
// The contacts of a lane are lane, lane + size, ...
#pragma once

#include "embed/proximal_small/numbers.hpp"

namespace fclib::proximal_small {

/// The number of contacts of the present problem; `Fixed`, if all problems have that many.
template <int Fixed>
struct Count {
  static constexpr int nc = Fixed;
  FCLIB_LANES void set(int) {}
};
template <>
struct Count<0> {
  int nc = 0;
  FCLIB_LANES void set(int contacts) { nc = contacts; }
};

/// What all systems keep.
template <class Law_, class Group_, int Fixed = 0>
struct Shared : Count<Fixed> {
  using Law = Law_;
  using Group = Group_;
  static constexpr int D = Law::dim;

  Group group;
  double* x;       // (D nc) what contacts tell one another
  double* slopes;  // (D D nc) D of each contact, by rows

  FCLIB_LANES static constexpr int room(int most_contacts) { return (D + D * D) * most_contacts; }
  FCLIB_LANES double* place(double* at, int most_contacts) {
    x = at;
    slopes = x + D * most_contacts;
    return slopes + D * D * most_contacts;
  }

  /// Shows the lane's x to the group.
  template <int Own>
  FCLIB_LANES void share(const double (&own)[Own][D]) {
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a >= this->nc) break;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) x[D * a + k] = own[o][k];
    }
    group.sync();
  }

  /// F of a contact, and D.
  FCLIB_LANES void put(int a, const double* F, const double* slope) {
    FCLIB_UNROLL
    for (int k = 0; k < D; ++k) x[D * a + k] = F[k];
    FCLIB_UNROLL
    for (int k = 0; k < D * D; ++k) slopes[D * D * a + k] = slope[k];
  }

  /// dp = -F - D y of a contact.
  FCLIB_LANES void step(int a, const double* y, double* dp) const {
    FCLIB_UNROLL
    for (int k = 0; k < D; ++k) {
      dp[k] = -x[D * a + k];
      FCLIB_UNROLL
      for (int l = 0; l < D; ++l) dp[k] -= slopes[D * D * a + D * k + l] * y[l];
    }
  }
};

}  // namespace fclib::proximal_small
