/* A mass that falls on the ground and slides, step by step; argv[1] steps. */
#include <fclib.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(holds)                                                                       \
  do {                                                                                     \
    if (!(holds)) {                                                                        \
      fprintf(stderr, "%s:%d: %s (%s)\n", __FILE__, __LINE__, #holds, fclib_last_error()); \
      return 1;                                                                            \
    }                                                                                      \
  } while (0)

int main(int argc, char** argv) {
  const int steps = argc > 1 ? atoi(argv[1]) : 10;
  int p[4] = {0, 1, 2, 3}, i[3] = {0, 1, 2};
  double x[3] = {1, 1, 1}, q[3] = {0, 0, 0}, mu[1] = {0.3};
  double r[3], u[3] = {0, 1, 0}, error = 1;
  const size_t name[1] = {42};
  enum fclib_status status = FCLIB_DIVERGED;
  struct fclib_matrix W;
  struct fclib_local problem;
  struct fclib_workspace* workspace = fclib_workspace_new();
  int k;

  fclib_set_error_handler(NULL, NULL);
  memset(&W, 0, sizeof W);
  memset(&problem, 0, sizeof problem);
  W.nzmax = 3;
  W.m = W.n = 3;
  W.nz = -1;
  W.p = p;
  W.i = i;
  W.x = x;
  problem.spacedim = 3;
  problem.W = &W;
  problem.q = q;
  problem.mu = mu;
  CHECK(workspace);
  for (k = 0; k < steps; ++k) {
    q[0] = u[0] - 0.01;
    q[1] = u[1];
    CHECK(fclib_workspace_solve(workspace, &problem, name, 0, r, u, &status, &error));
    CHECK(status == FCLIB_CONVERGED && error <= 1e-8);
  }
  CHECK(fabs(u[1] - (1 - 0.003 * steps)) < 1e-9);

  { /* nothing touches: in any storage, with pointers or without */
    struct fclib_matrix nothing = W;
    int start[1] = {0}, storage;
    nothing.nzmax = nothing.m = nothing.n = 0;
    nothing.i = NULL;
    nothing.x = NULL;
    problem.W = &nothing;
    for (storage = -3; storage <= 0; ++storage) {
      nothing.nz = storage;
      nothing.p = start;
      CHECK(fclib_workspace_solve(workspace, &problem, NULL, 0, r, u, &status, &error));
      CHECK(status == FCLIB_CONVERGED && error == 0);
      nothing.p = NULL;
      CHECK(fclib_workspace_solve(workspace, &problem, NULL, 0, NULL, NULL, &status, &error));
    }
    problem.W = &W;
  }
  { /* joints are not for it */
    struct fclib_matrix joint = W;
    joint.n = 1;
    problem.V = &joint;
    CHECK(!fclib_workspace_solve(workspace, &problem, NULL, 0, r, u, NULL, NULL));
    CHECK(strstr(fclib_last_error(), "bilateral constraints"));
    problem.V = NULL;
  }

  i[2] = 3;
  CHECK(!fclib_workspace_solve(workspace, &problem, NULL, 0, r, u, NULL, NULL));
  CHECK(strstr(fclib_last_error(), "W: "));
  i[2] = 2;
  { /* more entries than there is room for, and half a contact */
    struct fclib_matrix triplets = W;
    triplets.nz = 3;
    triplets.nzmax = 1;
    triplets.p = W.i;
    problem.W = &triplets;
    CHECK(!fclib_workspace_solve(workspace, &problem, NULL, 0, r, u, NULL, NULL));
    CHECK(strstr(fclib_last_error(), "nzmax"));
    triplets.nzmax = 0; /* as programs for libfclib 3.1 may leave it */
    CHECK(fclib_validate_local(&problem));
    CHECK(fclib_workspace_solve(workspace, &problem, NULL, 0, r, u, &status, &error));
    CHECK(status == FCLIB_CONVERGED && error <= 1e-8);
    triplets.nzmax = 3;
    triplets.m = triplets.n = W.m + 1;
    CHECK(!fclib_workspace_solve(workspace, &problem, NULL, 0, r, u, NULL, NULL));
    CHECK(strstr(fclib_last_error(), "spacedim"));
    problem.W = &W;
  }
  W.p = NULL;
  CHECK(!fclib_workspace_solve(workspace, &problem, NULL, 0, r, u, NULL, NULL));
  CHECK(!fclib_workspace_solve(NULL, &problem, NULL, 0, r, u, NULL, NULL));
  fclib_workspace_forget(NULL);
  CHECK(strstr(fclib_last_error(), "workspace"));
  fclib_workspace_forget(workspace);
  fclib_workspace_delete(workspace);
  fclib_workspace_delete(NULL);
  return 0;
}
