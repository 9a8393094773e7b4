// The kernel of the method of solver.hpp, compiled by NVRTC for the sizes of a batch. Given as
// macros:
//
//   SPACEDIM
//   CONTACTS   the most of a problem
//   FIXED      CONTACTS if all problems have as many, else 0
//   FORM       0: W; 1: bodies; 2: bodies with few coordinates
//   COPIES     of W: whether it is given by rows and copied to shared memory; else it is by columns
//   COORDINATES, WIDTH   of bodies: their number, and how many of them a contact touches at most
//   LANES      of a group: a part of a warp, or a block of more than 32 threads
//   WARPS      of a block, if LANES is at most 32
//   WAITING    so many groups of a warp without a problem get new ones together: to read a problem
//              takes the whole warp about as long as a step
//   GLOBAL     whether the memory of a group is too large for a multiprocessor's
//
// Groups take one problem after another from a counter, until there are none.
#include "embed/proximal_small/bodies.hpp"
#include "embed/proximal_small/dense.hpp"
#include "embed/proximal_small/few_coordinates.hpp"
#include "embed/proximal_small/groups.hpp"
#include "embed/proximal_small/law.hpp"
#include "embed/proximal_small/solver.hpp"

namespace small = fclib::proximal_small;

using Law = small::Law<SPACEDIM>;
#ifndef __CUDACC__
using Group = small::Serial;  // for tests
constexpr int threads = 1;
#elif LANES > 32
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
#elif FORM == 1
using System = small::Bodies<Law, Group>;
constexpr int needed = System::room(CONTACTS, COORDINATES, WIDTH);
#else
using System = small::FewCoordinates<Law, Group, COORDINATES, FIXED>;
constexpr int needed = System::room(CONTACTS);
#endif

/// Doubles of a group. The groups of a warp begin in banks of their own: 16 doubles fill all banks.
constexpr int space = LANES >= 16 ? (needed + 1) / 2 * 2 : (needed + 15 - LANES) / 16 * 16 + LANES;

/// Threads of a block, bytes of its memory, problems that it solves at a time.
extern "C" __global__ void sizes(int* out) {
  out[0] = threads;
  out[1] = space * groups * static_cast<int>(sizeof(double));
  out[2] = groups;
}

extern "C" __global__ void __launch_bounds__(threads)
    solve(long long count, int nc_each, const int* contacts, const long long* first,
          const long long* first_entry, const double* matrices, const double* inverse,
          long long inverse_stride, const double* velocity, const double* q, const double* mu,
          const double* guess, double tolerance, int most_steps, unsigned long long* counter,
          double* r, double* u, int* status, double* error, int* steps, double* workspace) {
  constexpr int D = SPACEDIM;
  using Solver = small::Solver<System, own>;
  Solver solver;
  const Group& group = solver.system.group;
#if LANES > 32
  __shared__ double scratch[4 * LANES / 32];
  __shared__ long long taken;
  solver.system.group.scratch = scratch;
#endif
#if GLOBAL
  double* at = workspace + static_cast<long long>(space) * groups * blockIdx.x;
#else
  extern __shared__ double memory[];
  double* at = memory;
#endif
#if LANES <= 32
  at += space * (threadIdx.x / LANES);
#endif
  // groups without a problem go through the steps too
  for (int k = group.lane(); k < space; k += LANES) at[k] = 0;
  group.sync();
#if FORM == 0
  solver.system.place(at, CONTACTS, COPIES);
#elif FORM == 1
  solver.system.place(at, CONTACTS, COORDINATES, WIDTH);
#else
  solver.system.place(at, CONTACTS);
#endif
  solver.rules.tolerance = tolerance;
  solver.rules.most_steps = most_steps;
  bool busy = false, more = true;
  long long k = 0;
  for (;;) {
    bool next = !busy && more;
#if WAITING > 1
    if (__popc(__ballot_sync(~0u, next)) < WAITING * LANES && group.anyone(busy)) next = false;
#endif
    if (group.anyone(next)) {
      long long number = 0;
      if (next && group.lane() == 0) number = static_cast<long long>(atomicAdd(counter, 1ull));
#if LANES > 32
      __syncthreads();
      if (threadIdx.x == 0) taken = number;
      __syncthreads();
      number = taken;
#elif LANES > 1
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
      Solver::Result result{};
      int nc = 0;
      if (mine) {
        nc = contacts != nullptr ? contacts[k] : nc_each;
        const long long a = first != nullptr ? first[k] : k * nc_each;
#if FORM == 0
        const long long m = static_cast<long long>(D) * nc;
        given = {matrices + (first_entry != nullptr ? first_entry[k] : k * m * m), q + D * a,
                 nullptr, nullptr};
#else
        given = {matrices + D * a * COORDINATES, inverse + k * inverse_stride,
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
