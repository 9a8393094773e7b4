// The contact law: Coulomb, or Coulomb with rolling; `Groups` of tangential components.
#pragma once

#include "embed/proximal_small/numbers.hpp"

namespace fclib::proximal_small {

template <int Dim, int Groups = 1>
struct Law {
  static constexpr int dim = Dim;
  static constexpr int groups = Groups;
  static constexpr int part = (Dim - 1) / Groups;  // components of a group

  double limit[Groups];  // mu, and mu_r

  FCLIB_LANES static double norm(const double* x) {
    if (part == 1) return absolute(x[0]);
    double sum = 0;
    FCLIB_UNROLL
    for (int k = 0; k < part; ++k) sum += x[k] * x[k];
    return square_root(sum);
  }

  /// f = p - A(z); returns its square.
  FCLIB_LANES double residual(const double* p, const double* z, double* f) const {
    const bool open = !(z[0] > 0);
    f[0] = open ? p[0] : p[0] - z[0];
    double square = f[0] * f[0];
    FCLIB_UNROLL
    for (int g = 0; g < groups; ++g) {
      const double* y = z + 1 + g * part;
      const double length = norm(y);
      const double radius = limit[g] * z[0];
      const double scale = open ? 0.0 : length > radius ? radius / length : 1.0;
      FCLIB_UNROLL
      for (int k = 0; k < part; ++k) {
        const int at = 1 + g * part + k;
        f[at] = p[at] - scale * y[k];
        square += f[at] * f[at];
      }
    }
    return square;
  }

  /// D = rho A'(z), by rows.
  FCLIB_LANES void slope(const double* z, double rho, double* D) const {
    FCLIB_UNROLL
    for (int k = 0; k < dim * dim; ++k) D[k] = 0;
    if (!(z[0] > 0)) return;
    D[0] = rho;
    FCLIB_UNROLL
    for (int g = 0; g < groups; ++g) {
      const int first = 1 + g * part;
      const double length = norm(z + first);
      const bool slides = length > limit[g] * z[0];
      const double over = slides ? 1 / length : 0.0;
      const double side = slides ? rho * limit[g] * z[0] * over : rho;
      FCLIB_UNROLL
      for (int row = 0; row < part; ++row) {
        const double e = z[first + row] * over;
        D[(first + row) * dim] = rho * limit[g] * e;
        FCLIB_UNROLL
        for (int col = 0; col < part; ++col) {
          D[(first + row) * dim + first + col] =
              side * ((row == col ? 1.0 : 0.0) - e * (z[first + col] * over));
        }
      }
    }
  }

  /// x = p put into the cone. z decides whether it is open, sticks or slides; the values are p's.
  FCLIB_LANES void into_cone(const double* z, const double* p, double* x) const {
    const bool open = !(z[0] > 0) || !(p[0] > 0);
    x[0] = open ? 0.0 : p[0];
    FCLIB_UNROLL
    for (int g = 0; g < groups; ++g) {
      const int first = 1 + g * part;
      const double length = norm(p + first);
      const double radius = limit[g] * x[0];
      const bool slides = norm(z + first) > limit[g] * z[0];
      double scale = length > radius || (slides && length > 0) ? radius / length : 1.0;
      if (open) scale = 0;
      FCLIB_UNROLL
      for (int k = 0; k < part; ++k) x[first + k] = scale * p[first + k];
    }
  }

  /// ||r - P_K(r - rho u^)||^2, as contact/coulomb.hpp and contact/rolling.hpp have it. Sliding
  /// that is not faster than `slip` is none.
  FCLIB_LANES double natural_square(const double* u, const double* r, double rho,
                                    double slip) const {
    double y[dim], map[dim], left[groups], length[groups], speed[groups];
    FCLIB_UNROLL
    for (int k = 0; k < dim; ++k) {
      map[k] = rho * u[k];
      y[k] = r[k] - map[k];
    }
    double open = y[0], pressed = y[0];
    FCLIB_UNROLL
    for (int g = 0; g < groups; ++g) {
      const double sliding = norm(u + 1 + g * part);
      speed[g] = sliding <= slip ? 0.0 : rho * sliding;
      length[g] = norm(y + 1 + g * part);
      left[g] = length[g] - speed[g];
      open += limit[g] * left[g];
      pressed -= limit[g] * speed[g];
    }
    if (open <= 0) return square(r);
    bool sticks = pressed >= 0;
    FCLIB_UNROLL
    for (int g = 0; g < groups; ++g) sticks = sticks && length[g] <= limit[g] * pressed;
    double cut[groups];
    if (sticks) {
      FCLIB_UNROLL
      for (int g = 0; g < groups; ++g) {
        map[0] += limit[g] * speed[g];
        cut[g] = 0;
      }
    } else if (groups == 1) {
      const double beyond = (left[0] - limit[0] * y[0]) / (1 + limit[0] * limit[0]);
      map[0] -= limit[0] * beyond;
      cut[0] = speed[0] + beyond;
    } else {
      cut_both(y[0], left, length, speed, map[0], cut);
    }
    FCLIB_UNROLL
    for (int g = 0; g < groups; ++g) {
      if (length[g] == 0 || cut[g] <= 0) continue;  // NaN goes on
      const double scale = cut[g] / length[g];
      FCLIB_UNROLL
      for (int k = 0; k < part; ++k) map[1 + g * part + k] += scale * y[1 + g * part + k];
    }
    return square(map);
  }

 private:
  FCLIB_LANES static double square(const double* x) {
    double sum = 0;
    FCLIB_UNROLL
    for (int k = 0; k < dim; ++k) sum += x[k] * x[k];
    return sum;
  }

  /// Two limits, of which one or both bind: Rolling::natural.
  FCLIB_LANES void cut_both(double a, const double* left, const double* length, const double* speed,
                            double& normal, double* cut) const {
    constexpr int second = groups - 1;
    const int one = length[0] * limit[second] >= length[second] * limit[0] ? 0 : second;
    const int other = second - one;  // of two: the one that stops binding first
    const double weight = 1 + limit[one] * limit[one];
    const double idle = limit[other] * speed[other];
    const double n = (a + limit[one] * left[one] - idle) / weight;
    cut[one] = cut[other] = 0;
    if (length[other] > limit[other] * n) {
      const double total = weight + limit[other] * limit[other];
      const double turn = limit[second] * left[0] - limit[0] * left[second];
      const double beyond0 = left[0] - limit[0] * a, beyond1 = left[second] - limit[second] * a;
      cut[0] = speed[0] + (beyond0 + limit[second] * turn) / total;
      cut[second] = speed[second] + (beyond1 - limit[0] * turn) / total;
      normal -= (limit[0] * beyond0 + limit[second] * beyond1) / total;
    } else {
      cut[one] = speed[one] + (left[one] - limit[one] * (a - idle)) / weight;
      normal -= (limit[one] * (left[one] - limit[one] * a) - idle) / weight;
    }
  }
};

}  // namespace fclib::proximal_small
