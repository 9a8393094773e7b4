// W as a matrix.
#pragma once

#include "embed/proximal_small/equations.hpp"
#include "embed/proximal_small/system.hpp"

namespace fclib::proximal_small {

/// W as a matrix: all of it, or its blocks (D x D) that are not empty.
template <class Law, class Group, bool Sparse = false>
struct Dense : Shared<Law, Group> {
  using Base = Shared<Law, Group>;
  using Base::D;
  using Base::group;
  using Base::nc;
  using Base::slopes;
  using Base::x;

  /// One problem of the caller.
  struct Given {
    const double* W;     ///< (m x m) by columns; by rows if it is copied. Blocks: each by rows
    const double* q;     ///< (m)
    const int* starts;   ///< of blocks: (nc + 1) the first block of each contact, and
    const int* columns;  ///< the contact of each block's columns; the diagonal is among them
  };

  const double* W = nullptr;  // (m x m) by columns, or the blocks
  const int* starts = nullptr;
  const int* columns = nullptr;
  double* copy = nullptr;  // of W, or null
  double* S;               // (n x n + 1), n = padded(m)
  double* known;           // (m) the right-hand sides
  int ld;
  int* place_of;  // (nc) of a contact in the Newton system; -1 if it is open

  /// In doubles.
  FCLIB_LANES static constexpr int room(int most_contacts, bool copies) {
    const int m = D * most_contacts;
    return Base::room(most_contacts) + m + (copies ? m * m : 0) + padded(m) * (padded(m) + 1) +
           (most_contacts + 1) / 2;
  }
  FCLIB_LANES void place(double* at, int most_contacts, bool copies) {
    const int m = D * most_contacts;
    at = Base::place(at, most_contacts);
    known = at;
    at += m;
    ld = padded(m);
    S = at;
    at += ld * (ld + 1);
    if (copies) {
      copy = at;
      at += m * m;
    }
    place_of = reinterpret_cast<int*>(at);
  }

  /// q and sizes are the lane's (Own x D, Own). Returns whether this lane saw a bad entry.
  template <int Own>
  FCLIB_LANES bool take(bool mine, int contacts, const Given& given, double (&q)[Own][D],
                        double (&size)[Own]) {
    bool bad = false;
    if (mine) {
      this->set(contacts);
      const int m = D * nc;
      W = copy != nullptr ? copy : given.W;
      starts = given.starts;
      columns = given.columns;
      const int entries = Sparse ? D * D * starts[nc] : m * m;
      for (int k = group.lane(); k < entries; k += Group::size) {
        const double entry = given.W[k];
        bad = bad || !is_finite(entry);
        if (copy != nullptr) copy[Sparse ? k : k / m + k % m * m] = entry;
      }
      FCLIB_UNROLL
      for (int o = 0; o < Own; ++o) {
        const int a = group.lane() + o * Group::size;
        if (a >= nc) break;
        size[o] = 0;
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) {
          const int at = D * a + k;
          q[o][k] = given.q[at];
          bad = bad || !is_finite(q[o][k]);
          if (!Sparse) size[o] += absolute(given.W[at + m * at]) / D;
        }
        for (int e = Sparse ? starts[a] : 0; Sparse && e < starts[a + 1]; ++e) {
          if (columns[e] != a) continue;
          FCLIB_UNROLL
          for (int k = 0; k < D; ++k) {
            size[o] += absolute(given.W[D * D * e + (D + 1) * k]) / D;
          }
        }
      }
    }
    group.sync();
    return bad;
  }

  /// y = W x for the lane's contacts; x is the shared one.
  template <int Own>
  FCLIB_LANES void times_shared(double (&y)[Own][D]) const {
    const int m = D * nc;
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a >= nc) break;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) y[o][k] = 0;
      if (Sparse) {
        for (int e = starts[a]; e < starts[a + 1]; ++e) {
          FCLIB_UNROLL
          for (int k = 0; k < D; ++k) {
            FCLIB_UNROLL
            for (int l = 0; l < D; ++l) {
              y[o][k] += W[D * D * e + D * k + l] * x[D * columns[e] + l];
            }
          }
        }
        continue;
      }
      const double* column = W + D * a;
      for (int j = 0; j < m; ++j, column += m) {
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) y[o][k] += column[k] * x[j];
      }
    }
  }

  template <int Own>
  FCLIB_LANES void product(const double (&own)[Own][D], double (&y)[Own][D]) {
    this->share(own);
    times_shared(y);
    group.sync();
  }

  /// Open contacts have D = 0 and dp = -F; the others are the unknowns.
  template <int Own>
  FCLIB_LANES void solve(double (&dp)[Own][D]) {
    double moved[1] = {0};  // whether an open contact still has a reaction
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a >= nc) break;
      const bool open = slopes[D * D * a] == 0;
      place_of[a] = open ? -1 : 0;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) {
        const double F = x[D * a + k];
        dp[o][k] = open ? -F : 0.0;
        known[D * a + k] = -F;
        x[D * a + k] = dp[o][k];
        if (dp[o][k] != 0) moved[0] = 1;
      }
    }
    group.sync();
    group.sum(moved);
    if (group.anyone(moved[0] != 0)) {
      double y[Own][D];
      times_shared(y);
      FCLIB_UNROLL
      for (int o = 0; o < Own; ++o) {
        const int a = group.lane() + o * Group::size;
        if (a >= nc) break;
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) {
          FCLIB_UNROLL
          for (int l = 0; l < D; ++l) known[D * a + k] -= slopes[D * D * a + D * k + l] * y[o][l];
        }
      }
    }
    int count = 0;
    for (int a = 0; a < nc; ++a) count += place_of[a] >= 0;
    int at[Own];
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      at[o] = 0;
      for (int b = 0; b < a && b < nc; ++b) at[o] += place_of[b] >= 0;
    }
    group.sync();
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a < nc && place_of[a] >= 0) place_of[a] = at[o];
    }
    group.sync();
    const int used = D * count;
    const int n = group.most(padded(used));
    fill(used, n);
    eliminate(group, S, n, ld);
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a >= nc || place_of[a] < 0) continue;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) dp[o][k] = S[ld * n + D * place_of[a] + k];
    }
    group.sync();
  }

  /// S = I + D W and the right-hand side, with rows of the identity from `used` to n.
  FCLIB_LANES void fill(int used, int n) {
    const int m = D * nc;
    if (Sparse) fill_blocks(used, n);
    for (int k = group.lane(); !Sparse && k < nc * nc; k += Group::size) {
      const int a = k % nc, b = k / nc;
      const int to = D * place_of[a], from = D * place_of[b];
      if (to < 0 || from < 0) continue;
      const double* slope = slopes + D * D * a;
      FCLIB_UNROLL
      for (int j = 0; j < D; ++j) {
        const double* w = W + D * a + m * (D * b + j);
        double* s = S + to + ld * (from + j);
        FCLIB_UNROLL
        for (int i = 0; i < D; ++i) {
          double sum = a == b && i == j ? 1.0 : 0.0;
          FCLIB_UNROLL
          for (int l = 0; l < D; ++l) sum += slope[D * i + l] * w[l];
          s[i] = sum;
        }
      }
      if (a != b) continue;
      FCLIB_UNROLL
      for (int i = 0; i < D; ++i) S[ld * n + to + i] = known[D * a + i];
    }
    for (int k = group.lane(); k < n * (n - used); k += Group::size) {
      const int i = k % n, j = used + k / n;
      S[i + ld * j] = i == j ? 1.0 : 0.0;
      if (i < used) S[j + ld * i] = 0;
      if (i == j) S[i + ld * n] = 0;
    }
    group.sync();
  }

 private:
  /// The part of `fill` for the blocks: each lane has the rows of its contacts.
  FCLIB_LANES void fill_blocks(int used, int n) {
    for (int a = group.lane(); a < nc; a += Group::size) {
      const int to = D * place_of[a];
      if (to < 0) continue;
      FCLIB_UNROLL
      for (int i = 0; i < D; ++i) {
        for (int j = 0; j < used; ++j) S[to + i + ld * j] = to + i == j ? 1.0 : 0.0;
        S[ld * n + to + i] = known[D * a + i];
      }
      const double* slope = slopes + D * D * a;
      for (int e = starts[a]; e < starts[a + 1]; ++e) {
        const int from = D * place_of[columns[e]];
        if (from < 0) continue;
        FCLIB_UNROLL
        for (int i = 0; i < D; ++i) {
          FCLIB_UNROLL
          for (int j = 0; j < D; ++j) {
            double sum = 0;
            FCLIB_UNROLL
            for (int l = 0; l < D; ++l) sum += slope[D * i + l] * W[D * D * e + D * l + j];
            S[to + i + ld * (from + j)] += sum;
          }
        }
      }
    }
  }
};

}  // namespace fclib::proximal_small
