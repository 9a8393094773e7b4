// Local problems of a few contacts, each solved by a group of lanes: a thread, a team of threads, a
// part of a warp, or a block of a GPU. Plain C++, so that NVRTC compiles it for the device.
//
// The method is the proximal point algorithm of methods/proximal_point.hpp, with the same rules:
//
//   from r = guess or 0, until the error of r is at most the tolerance:
//     find p = A(r - rho (W p + q)), rho_a = kappa d / tr(W_aa)   by a semismooth Newton method
//     r = p, put into the cones
//     kappa grows if Newton's method took few steps, and falls if it failed
//
// A is the map of Alart & Curnier. A step of Newton's method is, with D = rho A',
//
//   W given (Dense)             (I + D W) dp = -F
//   W = B B^T given (Bodies)    (I + B^T D B) dv = -B^T F,  dp = -F - D B dv,  B = J M^-1/2
//
// A sweep of Gauss-Seidel goes from contact to contact. Here every lane has its contacts, and all
// of them work at once: that is why a GPU has this method and not the one of small_solver.hpp.
//
// The groups of a warp go through the same statements in step: what differs between problems is
// data and never a branch around a `sync`. `Group::anyone` asks all groups that run in step.
#pragma once

#ifndef __CUDACC_RTC__
#include <cmath>
#endif

#ifdef __CUDACC__
#define FCLIB_LANES __host__ __device__ __forceinline__
#define FCLIB_UNROLL _Pragma("unroll")
#else
#define FCLIB_LANES inline
#define FCLIB_UNROLL
#endif

namespace fclib::proximal_small {

// ---- numbers

constexpr double machine_epsilon = 2.220446049250313e-16;
/// As rounding_unit_of_q of merit/natural_sums.hpp.
constexpr double rounding_of_q = 4 * machine_epsilon;
#ifdef __CUDACC_RTC__
#define FCLIB_INFINITY __longlong_as_double(0x7ff0000000000000)
#else
#define FCLIB_INFINITY HUGE_VAL
#endif

FCLIB_LANES double square_root(double x) {
#ifdef __CUDACC_RTC__
  return ::sqrt(x);
#else
  return std::sqrt(x);
#endif
}
FCLIB_LANES double absolute(double x) { return x < 0 ? -x : x; }
/// The larger one; a if a is NaN.
FCLIB_LANES double larger(double a, double b) { return a < b ? b : a; }
FCLIB_LANES bool is_finite(double x) { return x - x == 0; }
/// Whether squares of numbers of this size are neither lost nor infinite.
FCLIB_LANES bool has_square(double x) { return x >= 1e-100 && x <= 1e100; }

// ---- what a caller gives and gets

/// How a problem ended.
enum class Ending {
  converged,  ///< the error, recomputed from r, is at most the tolerance
  unsolved,   ///< the best r that was found; for the solver `auto`
  invalid,    ///< an entry that is not finite, or a negative mu
};

/// kappa and the factors of its growth are those of ppa-nsn with a smaller kappa to begin with:
/// from 1 to 30, problems of 4 to 64 contacts take the same number of Newton steps within a tenth,
/// and more from 100 on.
struct Rules {
  double tolerance = 1e-8;
  double kappa = 10;
  double kappa_max = 1e8;
  double easy = 3;       ///< factor after 1 or 2 Newton steps; after 3 or 4, two thirds of it
  double hard = 0.5;     ///< factor after a failure
  int most_steps = 400;  ///< Newton steps of one problem
};

struct Answer {
  Ending ending = Ending::unsolved;
  double error = FCLIB_INFINITY;  ///< the larger of both maps
  int steps = 0;                  ///< of Newton's method
};

// ---- the contact law: Coulomb, or Coulomb with rolling; `Groups` of tangential components

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

// ---- groups of lanes

/// One lane: a thread of the host, or of the device.
struct Serial {
  static constexpr int size = 1;
  FCLIB_LANES int lane() const { return 0; }
  FCLIB_LANES void sync() const {}
  /// The sum of each x over the lanes, for all of them.
  template <int N>
  FCLIB_LANES void sum(double (&)[N]) const {}
  /// Whether x holds in any of the groups that run in step.
  FCLIB_LANES bool anyone(bool x) const { return x; }
  /// The largest n of the groups that run in step.
  FCLIB_LANES int most(int n) const { return n; }
};

#ifdef __CUDACC__
/// G lanes of a warp, whose groups run in step.
template <int G>
struct Lanes {
  static constexpr int size = G;
  static constexpr unsigned all = 0xffffffffu;
  __device__ __forceinline__ int lane() const { return threadIdx.x & (G - 1); }
  __device__ __forceinline__ void sync() const { __syncwarp(); }
  template <int N>
  __device__ __forceinline__ void sum(double (&x)[N]) const {
    FCLIB_UNROLL
    for (int far = G / 2; far > 0; far /= 2) {
      FCLIB_UNROLL
      for (int k = 0; k < N; ++k) x[k] += __shfl_xor_sync(all, x[k], far);
    }
  }
  __device__ __forceinline__ bool anyone(bool x) const { return __any_sync(all, x); }
  __device__ __forceinline__ int most(int n) const {
    return G == 32 ? n : __reduce_max_sync(all, n);
  }
};

/// A block of G threads.
template <int G>
struct Block {
  static constexpr int size = G;
  double* scratch;  // 4 for each warp, shared
  __device__ __forceinline__ int lane() const { return threadIdx.x; }
  __device__ __forceinline__ void sync() const { __syncthreads(); }
  template <int N>
  __device__ __forceinline__ void sum(double (&x)[N]) const {
    static_assert(N <= 4, "scratch is too short");
    FCLIB_UNROLL
    for (int far = 16; far > 0; far /= 2) {
      FCLIB_UNROLL
      for (int k = 0; k < N; ++k) x[k] += __shfl_xor_sync(0xffffffffu, x[k], far);
    }
    const int warp = threadIdx.x / 32;
    __syncthreads();
    if (threadIdx.x % 32 == 0) {
      for (int k = 0; k < N; ++k) scratch[4 * warp + k] = x[k];
    }
    __syncthreads();
    FCLIB_UNROLL
    for (int k = 0; k < N; ++k) {
      double total = 0;
      for (int w = 0; w < G / 32; ++w) total += scratch[4 * w + k];
      x[k] = total;
    }
  }
  __device__ __forceinline__ bool anyone(bool x) const { return x; }
  __device__ __forceinline__ int most(int n) const { return n; }
};
#endif

// ---- linear equations

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

// ---- how the contacts see one another: u = W x + q
//
// A system has the memory that the lanes of a group share. It offers
//
//   take      reads a problem: whether all entries are finite, q and the mean |W_kk| of each
//   contact product   y = W x of the lane's contacts put       F and D of a contact; solve then
//   gives the Newton step dp of the lane's contacts
//
// The contacts of a lane are lane, lane + size, ...

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

  /// F of a contact, and D.
  FCLIB_LANES void put(int a, const double* F, const double* slope) {
    FCLIB_UNROLL
    for (int k = 0; k < D; ++k) x[D * a + k] = F[k];
    FCLIB_UNROLL
    for (int k = 0; k < D * D; ++k) slopes[D * D * a + k] = slope[k];
  }
};

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
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a >= nc) break;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) x[D * a + k] = own[o][k];
    }
    group.sync();
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
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a >= nc) break;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) x[D * a + k] = own[o][k];
    }
    group.sync();
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
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) {
        dp[o][k] = -x[D * a + k];
        FCLIB_UNROLL
        for (int l = 0; l < D; ++l) dp[o][k] -= slopes[D * D * a + D * k + l] * y[l];
      }
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
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a >= nc) break;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) x[D * a + k] = own[o][k];
    }
    group.sync();
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
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) {
        dp[o][k] = -x[D * a + k];
        FCLIB_UNROLL
        for (int l = 0; l < D; ++l) dp[o][k] -= slopes[D * D * a + D * k + l] * y[l];
      }
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

// ---- the method

/// Solves one problem after another with its memory. `Own` is the largest number of contacts of a
/// lane. All members are called by all lanes of the groups that run in step; `mine` says whose
/// problem it is.
template <class System, int Own>
class Solver {
 public:
  using Law = typename System::Law;
  using Group = typename System::Group;
  static constexpr int D = Law::dim;
  using Vectors = double[Own][D];

  System system;
  Rules rules;

  /// Where r and u of the problem go, each (m).
  struct Result {
    double* r;
    double* u;
  };

  /// Begins a problem. limits (groups x nc): mu of each contact, then mu_r.
  FCLIB_LANES void begin(bool mine, int nc, const typename System::Given& given,
                         const double* const (&limits)[Law::groups], const double* guess,
                         const Result& result) {
    const Group& group = system.group;
    double size[Own] = {};
    bool bad = system.take(mine, nc, given, q_, size);
    double sums[4] = {0, 0, 0, 0};  // of the sizes, their number, bad entries, contacts that close
    if (mine) {
      result_ = result;
      FCLIB_UNROLL
      for (int o = 0; o < Own; ++o) {
        const int a = group.lane() + o * Group::size;
        if (a >= nc) break;
        FCLIB_UNROLL
        for (int g = 0; g < Law::groups; ++g) {
          law_[o].limit[g] = limits[g][a];
          bad = bad || !(law_[o].limit[g] >= 0) || !is_finite(law_[o].limit[g]);
        }
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) {
          r_[o][k] = guess != nullptr ? guess[D * a + k] : 0.0;
          bad = bad || !is_finite(r_[o][k]);
        }
        if (size[o] > 0) {
          sums[0] += size[o];
          sums[1] += 1;
        }
        if (!(q_[o][0] >= 0)) sums[3] = 1;
      }
    }
    if (bad) sums[2] = 1;
    group.sum(sums);
    const double other = sums[1] > 0 ? sums[1] / sums[0] : 1.0;
    double squares[4] = {0, 0, 0, 0};  // of q, of rho q, of numbers without one, entries of q
    if (mine) {
      answer_ = Answer{};
      FCLIB_UNROLL
      for (int o = 0; o < Own; ++o) {
        const int a = group.lane() + o * Group::size;
        if (a >= nc) break;
        rho_[o] = size[o] > 0 ? 1 / size[o] : other;
        double square = 0;
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) {
          square += q_[o][k] * q_[o][k];
          if (q_[o][k] != 0) squares[3] = 1;
          if (sums[3] == 0) r_[o][k] = 0;  // all contacts are open
        }
        if (!has_square(rho_[o])) squares[2] = 1;
        squares[0] += square;
        squares[1] += rho_[o] * rho_[o] * square;
      }
    }
    group.sum(squares);
    if (mine) {
      mean_ = nc > 0 ? square_root(squares[0] / nc) : 0.0;
      scale_ = squares[0] > 0 ? 1 / square_root(squares[0]) : 1.0;
      scaled_scale_ = squares[1] > 0 ? 1 / square_root(squares[1]) : 1.0;
      // nobody knows the error, and the problem is left
      if (squares[2] > 0 || (squares[3] > 0 && !(has_square(square_root(squares[0])) &&
                                                 has_square(square_root(squares[1]))))) {
        scale_ = FCLIB_INFINITY;
      }
      kappa_ = rules.kappa;
      cautious_ = 0;
    }
    if (mine) {
      state_ = State::begun;
      if (sums[2] > 0) {
        answer_.ending = Ending::invalid;
        FCLIB_UNROLL
        for (int o = 0; o < Own; ++o) {
          FCLIB_UNROLL
          for (int k = 0; k < D; ++k) r_[o][k] = FCLIB_INFINITY - FCLIB_INFINITY;  // NaN
        }
        copy(r_, u_);
        write();
      }
    }
  }

  FCLIB_LANES bool finished() const {
    return answer_.error <= rules.tolerance || answer_.ending == Ending::invalid ||
           answer_.steps >= rules.most_steps || kappa_ < least_kappa;
  }
  [[nodiscard]] FCLIB_LANES const Answer& answer() const { return answer_; }

  /// One step of Newton's method. Before it, the proximal step that the last one may have finished
  /// is judged, or the guess.
  FCLIB_LANES void advance(bool mine) {
    const bool candidate = mine && !finished() && state_ != State::inside;
    if (system.group.anyone(candidate)) judge_candidate(candidate);
    const bool solving = mine && !finished();
    if (system.group.anyone(solving)) newton_step(solving);
  }

 private:
  static constexpr int most_inner = 20;
  static constexpr int most_halvings = 5;
  static constexpr double least_kappa = 1e-6;

  enum class State {
    begun,   ///< r is the guess; nothing is known of it
    inside,  ///< Newton's method is on its way from r to p
    solved,  ///< p solves the inner problem, as far as its residual tells
  };

  FCLIB_LANES void judge_candidate(bool mine) {
    Vectors x{}, ux{};
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (system.group.lane() + o * Group::size >= system.nc) break;
      double z[D];
      argument(o, up_, z);
      law_[o].into_cone(z, p_[o], x[o]);
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) x[o][k] = state_ == State::begun ? r_[o][k] : x[o][k];
    }
    product(x, ux);
    double gap;
    const double error = judge(x, ux, gap);
    if (!mine) return;
    const bool begun = state_ == State::begun;
    state_ = State::inside;
    const bool taken =
        begun || gap <= 0.1 * error || gap <= 1e-15 || exact_ || error <= rules.tolerance;
    if (taken) {
      copy(x, r_);
      copy(ux, u_);
      accept(error);
      if (!begun) {
        double growth = inner_ <= 2 ? rules.easy : inner_ <= 4 ? rules.easy * 2 / 3 : 1.0;
        if (inner_ >= 9) growth = 0.5;
        if (cautious_ > 0) {
          growth = growth < 1.5 ? growth : 1.5;
          --cautious_;
        }
        kappa_ = kappa_ * growth < rules.kappa_max ? kappa_ * growth : rules.kappa_max;
      }
      restart();
    } else if (inner_ >= most_inner) {
      fail();
    }
    if (!is_finite(scale_)) kappa_ = 0;
  }

  FCLIB_LANES void newton_step(bool mine) {
    const Group& group = system.group;
    // F and its slope at p
    double sums[1] = {0};
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a >= system.nc) break;
      double z[D], F[D], slope[D * D];
      argument(o, up_, z);
      sums[0] += law_[o].residual(p_[o], z, F);
      law_[o].slope(z, kappa_ * rho_[o], slope);
      system.put(a, F, slope);
    }
    group.sync();
    group.sum(sums);
    const double norm = square_root(sums[0]);
    if (inner_ == 0) first_ = norm;
    Vectors x{}, ux{};
    system.solve(x);
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (group.lane() + o * Group::size >= system.nc) break;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) x[o][k] += p_[o][k];
    }
    product(x, ux);
    // the whole step, or less of it
    double length = 0, trial = 0;
    for (int halving = 0;; ++halving) {
      trial = residual_norm(x, ux, length);
      const bool shorter = mine && !(trial < norm);
      if (halving == most_halvings || !group.anyone(shorter)) break;
      if (!shorter) continue;
      FCLIB_UNROLL
      for (int o = 0; o < Own; ++o) {
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) {
          x[o][k] = p_[o][k] + 0.5 * (x[o][k] - p_[o][k]);
          ux[o][k] = up_[o][k] + 0.5 * (ux[o][k] - up_[o][k]);
        }
      }
    }
    if (!mine) return;
    ++answer_.steps;
    ++inner_;
    if (!(trial < 10 * norm) || (trial >= norm && ++rises_ == 2)) {
      fail();
      return;
    }
    copy(x, p_);
    copy(ux, up_);
    // or as small as the rounding, multiplied by rho, allows
    const double rounding = 10 * machine_epsilon * kappa_ * length;
    if (trial <= larger(1e-2 * first_, rounding)) {
      state_ = State::solved;
      exact_ = trial <= 1e-15 * length;
    } else if (inner_ >= most_inner) {
      fail();
    }
  }

  FCLIB_LANES void fail() {
    kappa_ *= rules.hard;
    cautious_ = 3;
    restart();
  }

  FCLIB_LANES void copy(const Vectors& from, Vectors& to) const {
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (system.group.lane() + o * Group::size >= system.nc) break;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) to[o][k] = from[o][k];
    }
  }

  FCLIB_LANES void restart() {
    copy(r_, p_);
    copy(u_, up_);
    inner_ = rises_ = 0;
  }

  /// r_ is the iterate, with this error; it is kept if it is the best so far.
  FCLIB_LANES void accept(double error) {
    if (!(error < answer_.error) && answer_.error < FCLIB_INFINITY) return;
    answer_.error = error;
    answer_.ending = error <= rules.tolerance ? Ending::converged : Ending::unsolved;
    write();
  }

  FCLIB_LANES void write() const {
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = system.group.lane() + o * Group::size;
      if (a >= system.nc) break;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) {
        result_.r[D * a + k] = r_[o][k];
        result_.u[D * a + k] = u_[o][k];
      }
    }
  }

  /// y = W x + q
  FCLIB_LANES void product(const Vectors& x, Vectors& y) {
    system.product(x, y);
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (system.group.lane() + o * Group::size >= system.nc) break;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) y[o][k] += q_[o][k];
    }
  }

  /// z = r - rho u
  FCLIB_LANES void argument(int o, const Vectors& u, double* z) const {
    FCLIB_UNROLL
    for (int k = 0; k < D; ++k) z[k] = r_[o][k] - kappa_ * rho_[o] * u[o][k];
  }

  FCLIB_LANES double residual_norm(const Vectors& x, const Vectors& ux, double& length) const {
    double sums[2] = {0, 0};
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (system.group.lane() + o * Group::size >= system.nc) break;
      double z[D], F[D];
      argument(o, ux, z);
      sums[0] += law_[o].residual(x[o], z, F);
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) sums[1] += x[o][k] * x[o][k];
    }
    system.group.sum(sums);
    length = square_root(sums[1]);
    return square_root(sums[0]);
  }

  FCLIB_LANES static double length_of(const double* x) {
    double sum = 0;
    FCLIB_UNROLL
    for (int k = 0; k < D; ++k) sum += x[k] * x[k];
    return square_root(sum);
  }

  /// Merit::error of x, u = W x + q, and how far the velocity of p is from u.
  FCLIB_LANES double judge(const Vectors& x, const Vectors& u, double& gap) const {
    // ||W_ab r_b|| is at most the root of D^2 / (rho_a rho_b) times ||r_b||, if W is a Gram matrix
    double push[1] = {0};
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (system.group.lane() + o * Group::size >= system.nc) break;
      push[0] += D * length_of(x[o]) / square_root(rho_[o]);
    }
    system.group.sum(push);
    double sums[4] = {0, 0, 0, 0};  // plain, impulses, velocities, gap
    double lost[2] = {0, 0};        // by rounding, as velocities and as impulses
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (system.group.lane() + o * Group::size >= system.nc) break;
      double square = 0;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) {
        square += q_[o][k] * q_[o][k];
        sums[3] += (up_[o][k] - u[o][k]) * (up_[o][k] - u[o][k]);
      }
      const double slip = rounding_of_q * larger(square_root(square), mean_);
      double limits = 1;
      FCLIB_UNROLL
      for (int g = 0; g < Law::groups; ++g) limits += law_[o].limit[g];
      const double speed = square_root(square) + push[0] / square_root(rho_[o]);
      const double size = length_of(x[o]);
      lost[0] += limits * (speed + larger(size, size / rho_[o]));
      lost[1] += limits * (rho_[o] * speed + size);
      sums[0] += law_[o].natural_square(u[o], x[o], 1.0, slip);
      const double scaled = law_[o].natural_square(u[o], x[o], rho_[o], slip);
      sums[1] += scaled;
      sums[2] += larger(scaled / (rho_[o] * rho_[o]), u[o][0] < 0 ? u[o][0] * u[o][0] : 0.0);
    }
    system.group.sum(lost);
    system.group.sum(sums);
    gap = square_root(sums[3]) * scale_;
    // a NaN in any of them is no small error
    if (!is_finite(sums[0] + sums[1] + sums[2] + scale_)) return FCLIB_INFINITY;
    const double plain = square_root(larger(sums[0], sums[2])) * scale_;
    const double error = larger(plain, square_root(sums[1]) * scaled_scale_);
    // what rounding may hide counts if the tolerance would notice
    const double hidden =
        machine_epsilon * (D * system.nc + 40) * larger(lost[0] * scale_, lost[1] * scaled_scale_);
    return hidden <= 1e-3 * rules.tolerance ? error : error + hidden;
  }

  Law law_[Own];
  double rho_[Own];
  double q_[Own][D];
  double r_[Own][D], u_[Own][D];   // the last proximal step
  double p_[Own][D], up_[Own][D];  // the last Newton step
  double kappa_ = 1, first_ = 0, mean_ = 0, scale_ = 1, scaled_scale_ = 1;
  int inner_ = 0, rises_ = 0, cautious_ = 0;
  bool exact_ = false;
  State state_ = State::begun;
  Answer answer_;
  Result result_;
};

}  // namespace fclib::proximal_small
