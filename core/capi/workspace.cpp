// fclib_workspace_*: the arrays are the caller's, and only the answer is copied.
#include "embed/workspace.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include "capi/errors.hpp"
#include "capi/from_c.hpp"
#include "capi/status.hpp"
#include "linalg/places.hpp"

struct fclib_workspace {
  fclib::Workspace core;
};

namespace fclib::c {

namespace {

MatrixView view_of(const fclib_matrix& c) {
  MatrixView view;
  const auto size = [](int number, const char* name) {
    if (number < 0) fail(name, "is negative");
    return number;
  };
  view.rows = size(c.m, "problem->W->m");
  view.cols = size(c.n, "problem->W->n");
  const auto need = [](auto* array, const char* name) {
    if (array == nullptr) fail(name, "is NULL");
    return array;
  };
  if (c.nz == -3) {
    view.storage = Storage::dense;
    view.nnz = static_cast<std::int64_t>(view.rows) * view.cols;
  } else {
    view.storage = c.nz == -1 ? Storage::csc : c.nz == -2 ? Storage::csr : Storage::triplet;
    if (c.nz < -3) fail("problem->W->nz", "is no storage");
    if (c.nz >= 0) require_nzmax(c, "problem->W->nz");
    if (c.nz >= 0 ? c.nz > 0 : view.rows > 0) view.p = need(c.p, "problem->W->p");
    view.nnz = c.nz >= 0           ? c.nz
               : view.p != nullptr ? view.p[view.storage == Storage::csc ? view.cols : view.rows]
                                   : 0;
    if (c.nz < 0 && view.nnz > c.nzmax) fail("problem->W->nzmax", "is less than the pointers say");
    if (c.nz < 0 && view.nnz == 0 && c.nzmax > 1 && c.x != nullptr) {
      require_counted({c.x, static_cast<std::size_t>(c.nzmax)}, 0, "problem->W->p");
    }
    if (view.nnz > 0) view.i = need(c.i, "problem->W->i");
  }
  if (view.nnz > 0) view.x = need(c.x, "problem->W->x");
  return view;
}

int solve(fclib_workspace* workspace, const fclib_local* c, const size_t* contacts,
          double tolerance, double* r, double* u, fclib_status* status, double* error) {
  return guarded(0, [&] {
    Workspace& core = given(workspace, "workspace").core;
    const fclib_local& problem = given(c, "problem");
    LocalView view;
    view.spacedim = problem.spacedim;
    if (view.spacedim != 2 && view.spacedim != 3) fail("problem->spacedim", "is neither 2 nor 3");
    const bool joints =
        (problem.V != nullptr && problem.V->n > 0) || (problem.R != nullptr && problem.R->m > 0);
    if (joints) fail("problem", "has bilateral constraints, which a workspace does not take");
    view.W = view_of(given(problem.W, "problem->W"));
    const auto m = static_cast<std::size_t>(view.W.rows);
    const auto d = static_cast<std::size_t>(view.spacedim);
    if (m % d != 0) fail("problem->W->m", "is no multiple of spacedim");
    const std::size_t nc = m / d;
    if (m > 0) {
      view.q = {&given(problem.q, "problem->q"), m};
      view.mu = {&given(problem.mu, "problem->mu"), nc};
      given(r, "r");
    }
    if (!(tolerance >= 0)) fail("tolerance", "must not be negative");
    Workspace::Settings settings;
    if (tolerance > 0) settings.tolerance = tolerance;
    // names are as wide as a pointer
    std::vector<std::int64_t> wide;
    std::span<const std::int64_t> names;
    if constexpr (sizeof(size_t) == sizeof(std::int64_t)) {
      names = {reinterpret_cast<const std::int64_t*>(contacts), contacts != nullptr ? nc : 0};
    } else if (contacts != nullptr) {
      wide.assign(contacts, contacts + nc);
      names = wide;
    }
    const Workspace::Answer answer = core.solve(view, names, settings);
    std::copy(answer.r.begin(), answer.r.end(), r);
    if (u != nullptr) std::copy(answer.u.begin(), answer.u.end(), u);
    if (status != nullptr) *status = status_in_c(answer.status);
    if (error != nullptr) *error = answer.error;
    return 1;
  });
}

}  // namespace

}  // namespace fclib::c

extern "C" {

fclib_workspace* fclib_workspace_new(void) {
  return fclib::c::guarded<fclib_workspace*>(
      nullptr, [] { return std::make_unique<fclib_workspace>().release(); });
}

void fclib_workspace_delete(fclib_workspace* workspace) { delete workspace; }

int fclib_workspace_solve(fclib_workspace* workspace, const fclib_local* problem,
                          const size_t* contacts, double tolerance, double* r, double* u,
                          fclib_status* status, double* error) {
  return fclib::c::solve(workspace, problem, contacts, tolerance, r, u, status, error);
}

void fclib_workspace_forget(fclib_workspace* workspace) {
  fclib::c::guarded(0, [&] {
    fclib::c::given(workspace, "workspace").core.forget();
    return 1;
  });
}

}  // extern "C"
