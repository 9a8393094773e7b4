// W by its bodies.
#pragma once

#include "embed/proximal_small/equations.hpp"
#include "embed/proximal_small/system.hpp"

namespace fclib::proximal_small {

/// J, of contacts that touch few bodies, and M^-1, diagonal: W = B B^T, B = J M^-1/2.
template <class Law, class Group>
struct Bodies : Shared<Law, Group> {
  using Base = Shared<Law, Group>;
  using Base::D;
  using Base::group;
  using Base::nc;
  using Base::slopes;
  using Base::x;

  struct Given {
    const double* J;         ///< (m x nv) by rows
    const double* inverse;   ///< (nv) 1 / M
    const double* velocity;  ///< (nv) free velocity of the bodies, or null
    const double* q;         ///< (m) what is added to J velocity, or null
  };

  int nv = 0;
  int width = 0;  // most columns of a contact that are not empty
  int stride;     // of a contact in B: odd, so that the lanes do not meet in one bank
  double* B;      // (D x width) of each contact
  double* v;      // (nv)
  double* K;      // (n x n + 1), n = padded(nv)
  int ld;
  int* column;  // (width) of each contact: which column of J; nv if there is none
  int* start;   // (nv + 1) entries of a column ...
  int* entry;   // ... contact << 16 | place in its B

  FCLIB_LANES static constexpr int room(int most_contacts, int nv, int width) {
    const int ints = 2 * most_contacts * width + nv + 1;
    return Base::room(most_contacts) + ((D * width) | 1) * most_contacts + nv +
           padded(nv) * (padded(nv) + 1) + (ints + 1) / 2;
  }
  FCLIB_LANES void place(double* at, int most_contacts, int nv_, int width_) {
    nv = nv_;
    width = width_;
    stride = (D * width) | 1;
    ld = padded(nv);
    at = Base::place(at, most_contacts);
    B = at;
    at += stride * most_contacts;
    v = at;
    at += nv;
    K = at;
    at += ld * (ld + 1);
    column = reinterpret_cast<int*>(at);
    entry = column + most_contacts * width;
    start = entry + most_contacts * width;
  }

  template <int Own>
  FCLIB_LANES bool take(bool mine, int contacts, const Given& given, double (&q)[Own][D],
                        double (&size)[Own]) {
    bool bad = false;
    if (mine) {
      this->set(contacts);
      FCLIB_UNROLL
      for (int o = 0; o < Own; ++o) {
        const int a = group.lane() + o * Group::size;
        if (a >= nc) break;
        size[o] = 0;
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) {
          q[o][k] = given.q != nullptr ? given.q[D * a + k] : 0.0;
        }
        int found = 0;
        for (int d = 0; d < nv; ++d) {
          const double inverse = given.inverse[d];
          const double velocity = given.velocity != nullptr ? given.velocity[d] : 0.0;
          bad = bad || !(inverse >= 0) || !is_finite(inverse);
          double here[D];
          bool any = false;
          FCLIB_UNROLL
          for (int k = 0; k < D; ++k) {
            here[k] = given.J[(D * a + k) * nv + d];
            any = any || here[k] != 0;  // NaN is not 0
            q[o][k] += here[k] * velocity;
            size[o] += here[k] * here[k] * inverse / D;
          }
          if (!any || found == width) {
            bad = bad || any;
            continue;
          }
          const double root = square_root(inverse);
          FCLIB_UNROLL
          for (int k = 0; k < D; ++k) B[a * stride + k * width + found] = here[k] * root;
          column[a * width + found++] = d;
        }
        for (; found < width; ++found) {
          FCLIB_UNROLL
          for (int k = 0; k < D; ++k) B[a * stride + k * width + found] = 0;
          column[a * width + found] = nv;
        }
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) bad = bad || !is_finite(q[o][k]);
        bad = bad || !is_finite(size[o]);
      }
    }
    group.sync();
    if (mine) {
      // the contacts of each column
      for (int d = group.lane(); d <= nv; d += Group::size) {
        int before = 0;
        for (int k = 0; k < nc * width; ++k) before += column[k] < d;
        start[d] = before;
        if (d == nv) break;
        for (int a = 0; a < nc; ++a) {
          for (int j = 0; j < width; ++j) {
            if (column[a * width + j] == d) entry[before++] = a << 16 | j;
          }
        }
      }
    }
    group.sync();
    return bad;
  }

  /// to = sign B^T x, with the shared x.
  FCLIB_LANES void gather(double* to, double sign) const {
    for (int d = group.lane(); d < nv; d += Group::size) {
      double sum = 0;
      for (int e = start[d]; e < start[d + 1]; ++e) {
        const int a = entry[e] >> 16;
        const double* b = B + a * stride + (entry[e] & 0xffff);
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) sum += b[k * width] * x[D * a + k];
      }
      to[d] = sign * sum;
    }
    group.sync();
  }

  /// y = B from, of one contact.
  FCLIB_LANES void spread(int a, const double* from, double* y) const {
    FCLIB_UNROLL
    for (int k = 0; k < D; ++k) y[k] = 0;
    for (int j = 0; j < width; ++j) {
      const int d = column[a * width + j];
      if (d == nv) break;
      const double* b = B + a * stride + j;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) y[k] += b[k * width] * from[d];
    }
  }

  template <int Own>
  FCLIB_LANES void product(const double (&own)[Own][D], double (&y)[Own][D]) {
    this->share(own);
    gather(v, 1);
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a < nc) spread(a, v, y[o]);
    }
    group.sync();
  }

  template <int Own>
  FCLIB_LANES void solve(double (&dp)[Own][D]) {
    const int n = padded(nv);
    for (int k = group.lane(); k < n * (n + 1); k += Group::size) {
      K[k] = k % n == k / n ? 1.0 : 0.0;
    }
    group.sync();
    gather(K + ld * n, -1);
    fill(n);
    eliminate(group, K, n, ld);
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a >= nc) break;
      double y[D];
      spread(a, K + ld * n, y);
      this->step(a, y, dp[o]);
    }
    group.sync();
  }

  /// K = I + B^T D B. Each lane has its rows; if there are more lanes, each has some columns of a
  /// row.
  FCLIB_LANES void fill(int n) {
    int rows = Group::size;
    while (rows > 1 && rows / 2 >= n) rows /= 2;
    const int part = group.lane() / rows;
    const int parts = Group::size / rows;
    for (int i = group.lane() & (rows - 1); i < nv; i += rows) {
      for (int e = start[i]; e < start[i + 1]; ++e) {
        const int a = entry[e] >> 16;
        const double* slope = slopes + D * D * a;
        if (slope[0] == 0) continue;
        const double* b = B + a * stride;
        const int own = entry[e] & 0xffff;
        double t[D];
        FCLIB_UNROLL
        for (int l = 0; l < D; ++l) {
          t[l] = 0;
          FCLIB_UNROLL
          for (int k = 0; k < D; ++k) t[l] += b[k * width + own] * slope[D * k + l];
        }
        for (int j = 0; j < width; ++j) {
          const int d = column[a * width + j];
          if (d == nv) break;
          if ((d & (parts - 1)) != part) continue;
          double sum = 0;
          FCLIB_UNROLL
          for (int l = 0; l < D; ++l) sum += t[l] * b[l * width + j];
          K[i + ld * d] += sum;
        }
      }
    }
    group.sync();
  }
};

}  // namespace fclib::proximal_small
