// fclib_solve_batch, fclib_batch_vjp, fclib_batch_jvp: the arrays are the caller's, nothing is
// copied.
#include "embed/batch.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "capi/errors.hpp"
#include "capi/status.hpp"
#include "embed/derivatives.hpp"

namespace fclib::c {

namespace {

static_assert(sizeof(int) == sizeof(std::int32_t));
static_assert(sizeof(fclib_status) == sizeof(std::int32_t));

/// The C value of each status of the core.
std::array<std::int32_t, status_count> codes() {
  std::array<std::int32_t, status_count> result{};
  for (std::size_t k = 0; k < result.size(); ++k) {
    result[k] = static_cast<std::int32_t>(status_in_c(static_cast<Status>(k)));
  }
  return result;
}

/// -1 in C: as many as the machine has.
int threads_of(int threads) {
  if (threads < -1) fail("threads", "must be -1 or more");
  return threads == -1 ? 0 : std::max(threads, 1);
}

int solve(const fclib_batch* given_batch) {
  return guarded(0, [&] {
    const std::size_t size = given(given_batch, "batch").size;
    // the members of the first version
    if (size < offsetof(fclib_batch, iterations) + sizeof(int*)) {
      fail("batch->size", "is " + std::to_string(size) + ", expected sizeof(struct fclib_batch)");
    }
    fclib_batch c{};
    std::memcpy(&c, given_batch, std::min(size, sizeof c));
    static const auto numbers = codes();
    Batch batch;
    batch.spacedim = c.spacedim;
    batch.count = c.count;
    batch.nc = c.nc;
    batch.nc_each = c.nc_each;
    const bool any = c.count > 0 && (c.nc != nullptr || c.nc_each > 0);
    const auto need = [&](auto* array, const char* name) {
      if (any) given(array, name);
      return array;
    };
    if (c.M != nullptr) {
      if (c.W != nullptr) fail("batch->W", "must be NULL if M is given");
      batch.M = c.M;
      batch.n = c.n;
      batch.n_each = c.n_each;
      batch.H = need(c.H, "batch->H");
      batch.f = need(c.f, "batch->f");
      batch.w = c.w_free;
      batch.v = c.v;
    } else {
      batch.q = need(c.q, "batch->q");
      batch.starts = c.starts;
      batch.one_pattern = c.one_pattern != 0;
      batch.columns = c.columns;
      batch.W = c.W;
      if (c.starts == nullptr) {
        need(c.W, "batch->W");
      } else if (c.count > 0) {
        constexpr std::ptrdiff_t most = 15000;  // contacts, as in core/embed/batch.cpp
        const auto* starts = c.starts;          // of each problem, or of the first one for all
        for (std::int64_t k = 0; k < (c.one_pattern != 0 ? 1 : c.count); ++k) {
          const auto nc = static_cast<std::ptrdiff_t>(c.nc != nullptr ? c.nc[k] : c.nc_each);
          if (nc < 0 || nc > most) break;  // the solve refuses it
          if (starts[nc] > 0) {
            given(c.columns, "batch->columns");
            given(c.W, "batch->W");
            break;
          }
          starts += nc + 1;
        }
      }
    }
    batch.mu = need(c.mu, "batch->mu");
    batch.mu_r = c.mu_r;
    batch.mu_s = c.mu_s;
    batch.coupled = c.coupled != 0;
    batch.guess = c.guess;
    batch.r = need(c.r, "batch->r");
    batch.u = c.u;
    batch.status = reinterpret_cast<std::int32_t*>(c.status);
    batch.codes = numbers.data();
    batch.error = c.error;
    batch.iterations = c.iterations;
    if (!(c.tolerance >= 0)) fail("batch->tolerance", "must not be negative");
    if (!(c.time_limit >= 0)) fail("batch->time_limit", "must not be negative");
    BatchSettings settings;
    if (c.tolerance > 0) settings.tolerance = c.tolerance;
    if (c.time_limit > 0) settings.time_limit = c.time_limit;
    settings.threads = threads_of(c.threads);
    const BatchOutcome outcome = solve_batch(batch, settings);
    if (outcome.invalid > 0 && c.status == nullptr) {
      fail("problem " + std::to_string(outcome.first_invalid), outcome.wrong);
    }
    return 1;
  });
}

SolvedBatch solved(const fclib_derivatives& c) {
  if (c.count < 0) fail("derivatives->count", "must not be negative");
  if (c.sides < 0) fail("derivatives->sides", "must not be negative");
  SolvedBatch batch;
  batch.spacedim = c.spacedim;
  batch.count = c.count;
  batch.nc = c.nc;
  batch.nc_each = c.nc_each;
  const bool any = c.count > 0 && (c.nc != nullptr || c.nc_each > 0);
  const auto need = [&](auto* array, const char* name) {
    if (any) given(array, name);
    return array;
  };
  batch.W = need(c.W, "derivatives->W");
  batch.q = need(c.q, "derivatives->q");
  batch.mu = need(c.mu, "derivatives->mu");
  batch.r = need(c.r, "derivatives->r");
  batch.degenerate = c.degenerate;
  batch.unique = c.unique;
  return batch;
}

int differentiate(const fclib_derivatives* given_derivatives, bool backwards) {
  return guarded(0, [&] {
    const std::size_t size = given(given_derivatives, "derivatives").size;
    if (size < offsetof(fclib_derivatives, unique) + sizeof(unsigned char*)) {
      fail("derivatives->size",
           "is " + std::to_string(size) + ", expected sizeof(struct fclib_derivatives)");
    }
    fclib_derivatives c{};
    std::memcpy(&c, given_derivatives, std::min(size, sizeof c));
    const SolvedBatch batch = solved(c);
    const std::int64_t sides = c.sides > 0 ? c.sides : 1;
    const DerivativeSettings settings{.threads = threads_of(c.threads)};
    if (backwards) {
      adjoint(batch, {sides, c.dr, c.du, c.dW, c.dq, c.dmu}, settings);
    } else {
      forward(batch, {sides, c.dW, c.dq, c.dmu, c.dr, c.du}, settings);
    }
    return 1;
  });
}

}  // namespace

}  // namespace fclib::c

extern "C" int fclib_solve_batch(const fclib_batch* batch) { return fclib::c::solve(batch); }

extern "C" int fclib_batch_vjp(const fclib_derivatives* derivatives) {
  return fclib::c::differentiate(derivatives, true);
}

extern "C" int fclib_batch_jvp(const fclib_derivatives* derivatives) {
  return fclib::c::differentiate(derivatives, false);
}
