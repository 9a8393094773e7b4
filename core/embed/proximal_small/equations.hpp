// Dense linear equations, solved by a group of lanes.
#pragma once

#include "embed/proximal_small/numbers.hpp"

namespace fclib::proximal_small {

/// A block of 3, inverted: the inverse is d times the entries i. `block` has `next` entries from a
/// row to the next.
struct Inverse {
  double i00, i01, i02, i10, i11, i12, i20, i21, i22, d;

  FCLIB_LANES Inverse(const double* row0, int next) {
    const double *row1 = row0 + next, *row2 = row1 + next;
    const double a00 = row0[0], a01 = row0[1], a02 = row0[2];
    const double a10 = row1[0], a11 = row1[1], a12 = row1[2];
    const double a20 = row2[0], a21 = row2[1], a22 = row2[2];
    i00 = a11 * a22 - a12 * a21;
    i01 = a02 * a21 - a01 * a22;
    i02 = a01 * a12 - a02 * a11;
    d = 1 / (a00 * i00 + a10 * i01 + a20 * i02);
    i10 = a12 * a20 - a10 * a22;
    i11 = a00 * a22 - a02 * a20;
    i12 = a02 * a10 - a00 * a12;
    i20 = a10 * a21 - a11 * a20;
    i21 = a01 * a20 - a00 * a21;
    i22 = a00 * a11 - a01 * a10;
  }
};

/// n, up to a multiple of 3.
FCLIB_LANES constexpr int padded(int n) { return (n + 2) / 3 * 3; }

/// Solves S x = b, n a multiple of 3: S (n x n) by columns of length `ld`, b in column n, where x
/// comes to stand. Gauss-Jordan elimination by blocks of 3, without pivots. If that loses digits,
/// the next residual of Newton's method shows it, and kappa falls.
template <class Group>
FCLIB_LANES void eliminate(const Group& group, double* S, int n, int ld) {
  // lanes: rows, and parts of the columns if there are more lanes than rows
  int rows = Group::size;
  while (rows > 1 && rows / 2 >= n) rows /= 2;
  const int row = group.lane() & (rows - 1);
  const int part = group.lane() / rows;
  const int parts = Group::size / rows;
  for (int k = 0; k < n; k += 3) {
    const double *c0 = S + ld * k, *c1 = c0 + ld, *c2 = c1 + ld;
    const Inverse of(c0 + k, ld);  // of the transposed block
    for (int i = row; i < n; i += rows) {
      if (i >= k && i < k + 3) continue;
      const double x0 = c0[i] * of.d, x1 = c1[i] * of.d, x2 = c2[i] * of.d;
      const double f0 = x0 * of.i00 + x1 * of.i01 + x2 * of.i02;
      const double f1 = x0 * of.i10 + x1 * of.i11 + x2 * of.i12;
      const double f2 = x0 * of.i20 + x1 * of.i21 + x2 * of.i22;
      double* x = S + ld * (k + 3 + part);
      for (int j = k + 3 + part; j <= n; j += parts, x += ld * parts) {
        x[i] -= f0 * x[k] + f1 * x[k + 1] + f2 * x[k + 2];
      }
    }
    group.sync();
  }
  double* b = S + ld * n;
  for (int k = 3 * group.lane(); k < n; k += 3 * Group::size) {
    const Inverse of(S + ld * k + k, ld);
    const double b0 = b[k] * of.d, b1 = b[k + 1] * of.d, b2 = b[k + 2] * of.d;
    b[k] = of.i00 * b0 + of.i10 * b1 + of.i20 * b2;
    b[k + 1] = of.i01 * b0 + of.i11 * b1 + of.i21 * b2;
    b[k + 2] = of.i02 * b0 + of.i12 * b1 + of.i22 * b2;
  }
  group.sync();
}

}  // namespace fclib::proximal_small
