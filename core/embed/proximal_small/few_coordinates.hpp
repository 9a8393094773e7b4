// W by its bodies, if they have few coordinates.
#pragma once

#include "embed/proximal_small/bodies.hpp"

namespace fclib::proximal_small {

/// J of problems with few coordinates, `Nv`, all of which a contact may touch. A lane keeps its
/// rows of K in registers; the rows that are eliminated go through shared memory.
template <class Law, class Group, int Nv, int Fixed = 0>
struct FewCoordinates : Shared<Law, Group, Fixed> {
  using Base = Shared<Law, Group, Fixed>;
  using Base::D;
  using Base::group;
  using Base::nc;
  using Base::slopes;
  using Base::x;
  using Given = typename Bodies<Law, Group>::Given;

  static constexpr int N = padded(Nv);        // the columns of B from Nv on are 0
  static constexpr int together = 3;          // columns that are read at once; more take registers
  static constexpr int stride = (D * N) | 1;  // of a contact in B, as in Bodies
  static constexpr int rows = (N + Group::size - 1) / Group::size;  // of a lane

  double* B;       // (D x N) of each contact
  double* v;       // (N)
  double* pivots;  // (N x N + 1), by rows: each as it is when it is eliminated

  FCLIB_LANES static constexpr int room(int most_contacts) {
    return Base::room(most_contacts) + stride * most_contacts + N + N * (N + 1);
  }
  FCLIB_LANES void place(double* at, int most_contacts) {
    B = Base::place(at, most_contacts);
    v = B + stride * most_contacts;
    pivots = v + N;
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
        for (int k = 0; k < D; ++k) q[o][k] = given.q != nullptr ? given.q[D * a + k] : 0.0;
        for (int first = 0; first < N; first += together) {
          double here[together][D], inverse[together], velocity[together];
          FCLIB_UNROLL
          for (int c = 0; c < together; ++c) {
            const int d = first + c;
            inverse[c] = d < Nv ? given.inverse[d] : 0.0;
            velocity[c] = d < Nv && given.velocity != nullptr ? given.velocity[d] : 0.0;
            FCLIB_UNROLL
            for (int k = 0; k < D; ++k) here[c][k] = d < Nv ? given.J[(D * a + k) * Nv + d] : 0.0;
          }
          FCLIB_UNROLL
          for (int c = 0; c < together; ++c) {
            const double root = square_root(inverse[c]);
            bad = bad || !(inverse[c] >= 0) || !is_finite(inverse[c]);
            FCLIB_UNROLL
            for (int k = 0; k < D; ++k) {
              q[o][k] += here[c][k] * velocity[c];
              size[o] += here[c][k] * here[c][k] * inverse[c] / D;
              B[a * stride + k * N + first + c] = here[c][k] * root;
            }
          }
        }
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) bad = bad || !is_finite(q[o][k]);
        bad = bad || !is_finite(size[o]);
      }
    }
    group.sync();
    return bad;
  }

  /// y = B from, of one contact.
  FCLIB_LANES void spread(int a, const double* from, double* y) const {
    FCLIB_UNROLL
    for (int k = 0; k < D; ++k) {
      y[k] = 0;
      FCLIB_UNROLL
      for (int d = 0; d < N; ++d) y[k] += B[a * stride + k * N + d] * from[d];
    }
  }

  template <int Own>
  FCLIB_LANES void product(const double (&own)[Own][D], double (&y)[Own][D]) {
    this->share(own);
    FCLIB_UNROLL
    for (int row = 0; row < rows; ++row) {
      const int d = group.lane() + row * Group::size;
      if (d >= N) break;
      double sum = 0;
      for (int a = 0; a < nc; ++a) {
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) sum += B[a * stride + k * N + d] * x[D * a + k];
      }
      v[d] = sum;
    }
    group.sync();
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a < nc) spread(a, v, y[o]);
    }
    group.sync();
  }

  template <int Own>
  FCLIB_LANES void solve(double (&dp)[Own][D]) {
    // K = I + B^T D B, and -B^T F behind it
    double K[rows][N + 1];
    FCLIB_UNROLL
    for (int row = 0; row < rows; ++row) {
      const int i = group.lane() + row * Group::size;
      FCLIB_UNROLL
      for (int j = 0; j <= N; ++j) K[row][j] = i == j ? 1.0 : 0.0;
    }
    for (int a = 0; a < nc; ++a) {
      const double* slope = slopes + D * D * a;
      double t[rows][D];
      FCLIB_UNROLL
      for (int row = 0; row < rows; ++row) {
        const int i = group.lane() + row * Group::size;
        FCLIB_UNROLL
        for (int l = 0; l < D; ++l) t[row][l] = 0;
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) {
          const double b = i < N ? B[a * stride + k * N + i] : 0.0;
          K[row][N] -= b * x[D * a + k];
          FCLIB_UNROLL
          for (int l = 0; l < D; ++l) t[row][l] += b * slope[D * k + l];
        }
      }
      if (slope[0] == 0)
        continue;  // no word to the other groups here: they may have fewer contacts
      FCLIB_UNROLL
      for (int j = 0; j < N; ++j) {
        FCLIB_UNROLL
        for (int l = 0; l < D; ++l) {
          const double b = B[a * stride + l * N + j];
          FCLIB_UNROLL
          for (int row = 0; row < rows; ++row) K[row][j] += t[row][l] * b;
        }
      }
    }
    eliminate_rows(K);
    FCLIB_UNROLL
    for (int row = 0; row < rows; ++row) {
      const int i = group.lane() + row * Group::size;
      if (i < N) v[i] = K[row][N];
    }
    group.sync();
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a >= nc) break;
      double y[D];
      spread(a, v, y);
      this->step(a, y, dp[o]);
    }
    group.sync();
  }

  /// As `eliminate`, but the rows of a block become rows of the identity at once.
  FCLIB_LANES void eliminate_rows(double (&K)[rows][N + 1]) const {
    FCLIB_UNROLL
    for (int k = 0; k < N; k += 3) {
      FCLIB_UNROLL
      for (int p = k; p < k + 3; ++p) {
        if (group.lane() != p % Group::size) continue;
        FCLIB_UNROLL
        for (int j = k; j <= N; ++j) pivots[p * (N + 1) + j] = K[p / Group::size][j];
      }
      group.sync();
      const double* block = pivots + k * (N + 1);
      const Inverse of(block + k, N + 1);
      FCLIB_UNROLL
      for (int row = 0; row < rows; ++row) {
        const int i = group.lane() + row * Group::size;
        const bool pivot = i >= k && i < k + 3;
        const double x0 = of.d * (pivot ? -double(i == k) : K[row][k]);
        const double x1 = of.d * (pivot ? -double(i == k + 1) : K[row][k + 1]);
        const double x2 = of.d * (pivot ? -double(i == k + 2) : K[row][k + 2]);
        const double f0 = x0 * of.i00 + x1 * of.i10 + x2 * of.i20;
        const double f1 = x0 * of.i01 + x1 * of.i11 + x2 * of.i21;
        const double f2 = x0 * of.i02 + x1 * of.i12 + x2 * of.i22;
        FCLIB_UNROLL
        for (int j = k + 3; j <= N; ++j) {
          K[row][j] = (pivot ? 0.0 : K[row][j]) -
                      (f0 * block[j] + f1 * block[N + 1 + j] + f2 * block[2 * (N + 1) + j]);
        }
      }
    }
    group.sync();
  }
};

}  // namespace fclib::proximal_small
