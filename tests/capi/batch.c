/* Two problems of one contact, solved in one call, as a simulator has them. */
#include <fclib.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define CHECK(holds)                                              \
  do {                                                            \
    if (!(holds)) {                                               \
      fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #holds); \
      return 1;                                                   \
    }                                                             \
  } while (0)

int main(void) {
  const double W[18] = {2, 0, 0, 0, 2, 0, 0, 0, 2, 2, 0, 0, 0, 2, 0, 0, 0, 2};
  const double q[6] = {-1, 0.2, 0, -1, 5, 0}; /* sticks, slides */
  const double mu[2] = {0.5, 0.5};
  double r[6], u[6], error[2];
  enum fclib_status status[2];
  int iterations[2];
  struct fclib_batch batch;

  fclib_set_error_handler(NULL, NULL);
  memset(&batch, 0, sizeof batch);
  batch.size = sizeof batch;
  batch.spacedim = 3;
  batch.count = 2;
  batch.nc_each = 1;
  batch.W = W;
  batch.q = q;
  batch.mu = mu;
  batch.r = r;
  CHECK(fclib_solve_batch(&batch) == 1);
  batch.u = u;
  batch.status = status;
  batch.error = error;
  batch.iterations = iterations;
  batch.threads = -1;
  CHECK(fclib_solve_batch(&batch) == 1);
  CHECK(status[0] == FCLIB_CONVERGED && status[1] == FCLIB_CONVERGED);
  CHECK(error[0] <= 1e-8 && error[1] <= 1e-8 && iterations[0] == 1);
  CHECK(fabs(r[0] - 0.5) < 1e-12 && fabs(r[1] + 0.1) < 1e-12);
  CHECK(fabs(r[3] - 0.5) < 1e-12 && fabs(r[4] + 0.25) < 1e-12);
  CHECK(fabs(u[4] - 4.5) < 1e-12);

  { /* no solution: the fast way gives up, auto proves it */
    const double none[9] = {0};
    batch.count = 1;
    batch.W = none;
    CHECK(fclib_solve_batch(&batch) == 1 && status[0] == FCLIB_INFEASIBLE);
    batch.W = W;
  }
  { /* wrong input is refused by its name */
    const double bad[2] = {0.5, NAN};
    batch.count = 2;
    batch.mu = bad;
    CHECK(fclib_solve_batch(&batch) == 0 && strstr(fclib_last_error(), "problem 1: mu"));
    batch.mu = NULL;
    CHECK(fclib_solve_batch(&batch) == 0 && strstr(fclib_last_error(), "batch->mu"));
    batch.mu = mu;
    batch.size = 8;
    CHECK(fclib_solve_batch(&batch) == 0 && strstr(fclib_last_error(), "batch->size"));
    CHECK(fclib_solve_batch(NULL) == 0);
  }
  return 0;
}
