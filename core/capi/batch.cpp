// fclib_solve_batch: the arrays are the caller's, nothing is copied.
#include "embed/batch.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "capi/errors.hpp"
#include "capi/status.hpp"

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

int solve(const fclib_batch* given_batch) {
  return guarded(0, [&] {
    const std::size_t size = given(given_batch, "batch").size;
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
    batch.W = need(c.W, "batch->W");
    batch.q = need(c.q, "batch->q");
    batch.mu = need(c.mu, "batch->mu");
    batch.guess = c.guess;
    batch.r = need(c.r, "batch->r");
    batch.u = c.u;
    batch.status = reinterpret_cast<std::int32_t*>(c.status);
    batch.codes = numbers.data();
    batch.error = c.error;
    batch.iterations = c.iterations;
    if (!(c.tolerance >= 0)) fail("batch->tolerance", "must not be negative");
    if (!(c.time_limit >= 0)) fail("batch->time_limit", "must not be negative");
    if (c.threads < -1) fail("batch->threads", "must be -1 or more");
    BatchSettings settings;
    if (c.tolerance > 0) settings.tolerance = c.tolerance;
    if (c.time_limit > 0) settings.time_limit = c.time_limit;
    settings.threads = c.threads == -1 ? 0 : std::max(c.threads, 1);
    solve_batch(batch, settings);
    return 1;
  });
}

}  // namespace

}  // namespace fclib::c

extern "C" int fclib_solve_batch(const fclib_batch* batch) { return fclib::c::solve(batch); }
