// The kernels of proximal_small.hpp, compiled by NVRTC for the sizes of a batch. Given as macros:
//
//   SPACEDIM, CONTACTS (the most of a problem), LANES (of a group: up to 32, or a block of more),
//   WARPS (of a block whose groups are parts of a warp)
//   FORM 0, W:      COPIES (whether W is copied to shared memory)
//   FORM 1, bodies: COORDINATES of a problem, WIDTH (most of them that a contact touches)
//
// Groups take one problem after another from a counter, until there are none.
#include "proximal_small.hpp"

namespace small = fclib::proximal_small;

using Law = small::Law<SPACEDIM>;
#if LANES > 32
using Group = small::Block<LANES>;
constexpr int threads = LANES;
#else
using Group = small::Lanes<LANES>;
constexpr int threads = 32 * WARPS;
#endif
constexpr int groups = threads / LANES;
constexpr int own = (CONTACTS + LANES - 1) / LANES;

#if FORM == 0
using System = small::Dense<Law, Group>;
constexpr int needed = System::room(CONTACTS, COPIES);
#else
using System = small::Bodies<Law, Group>;
constexpr int needed = System::room(CONTACTS, COORDINATES, WIDTH);
#endif

/// Doubles of a group. The groups of a warp begin in banks of their own: 16 doubles fill them.
constexpr int space = LANES >= 16 ? (needed + 1) / 2 * 2 : (needed + 15 - LANES) / 16 * 16 + LANES;

extern "C" __global__ void sizes(int* out) {
  out[0] = threads;
  out[1] = space * groups * static_cast<int>(sizeof(double));
  out[2] = groups;
}

extern "C" __global__ void __launch_bounds__(threads)
    solve(long long count, int nc_each, const int* contacts, const long long* first,
#if FORM == 0
          const double* W, const long long* first_entry, const double* q,
#else
          const double* J, const double* inverse, long long inverse_stride, const double* velocity,
          const double* q,
#endif
          const double* mu, const double* guess, double tolerance,
          int most_steps, unsigned long long* counter, double* r, double* u, int* status,
          double* error, int* steps) {
  extern __shared__ double memory[];
  constexpr int D = SPACEDIM;
  small::Solver<System, own> solver;
  const Group& group = solver.system.group;
#if LANES > 32
  __shared__ double scratch[4 * LANES / 32];
  __shared__ long long taken;
  solver.system.group.scratch = scratch;
  double* at = memory;
#else
  double* at = memory + space * (threadIdx.x / LANES);
#endif
  // groups without a problem go through the steps too
  for (int k = group.lane(); k < space; k += LANES) at[k] = 0;
  group.sync();
#if FORM == 0
  solver.system.place(at, CONTACTS, COPIES);
#else
  solver.system.place(at, CONTACTS, COORDINATES, WIDTH);
#endif
  solver.rules.tolerance = tolerance;
  solver.rules.most_steps = most_steps;
  bool busy = false, more = true;
  long long k = 0;
  for (;;) {
    const bool next = !busy && more;
    if (group.anyone(next)) {
      long long number = 0;
      if (next && group.lane() == 0) number = static_cast<long long>(atomicAdd(counter, 1ull));
#if LANES > 32
      __syncthreads();
      if (threadIdx.x == 0) taken = number;
      __syncthreads();
      number = taken;
#else
      number = __shfl_sync(~0u, number, 0, LANES);
#endif
      if (next) {
        k = number;
        more = k < count;
      }
      const bool mine = next && more;
      typename System::Given given{};
      const double* limits[1] = {nullptr};
      const double* start = nullptr;
      small::Solver<System, own>::Result result{};
      int nc = 0;
      if (mine) {
        nc = contacts != nullptr ? contacts[k] : nc_each;
        const long long a = first != nullptr ? first[k] : k * nc_each;
#if FORM == 0
        const long long m = static_cast<long long>(D) * nc;
        given = {W + (first_entry != nullptr ? first_entry[k] : k * m * m), q + D * a};
#else
        given = {J + D * a * COORDINATES, inverse + k * inverse_stride,
                 velocity != nullptr ? velocity + k * COORDINATES : nullptr,
                 q != nullptr ? q + D * a : nullptr};
#endif
        limits[0] = mu + a;
        start = guess != nullptr ? guess + D * a : nullptr;
        result = {r + D * a, u + D * a};
      }
      solver.begin(mine, nc, given, limits, start, result);
      busy = busy || mine;
    }
    if (!group.anyone(busy)) break;
    const bool solving = busy && !solver.finished();
    if (group.anyone(solving)) solver.advance(solving);
    if (busy && solver.finished()) {
      busy = false;
      if (group.lane() == 0) {
        const small::Answer& answer = solver.answer();
        status[k] = static_cast<int>(answer.ending);
        error[k] = answer.error;
        steps[k] = answer.steps;
      }
    }
  }
}
