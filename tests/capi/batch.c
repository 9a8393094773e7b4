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
  CHECK(error[0] <= 1e-8 && error[1] <= 1e-8 && iterations[0] > 0);
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
  { /* a bad problem has its status; without statuses it is named */
    const double bad[2] = {0.5, NAN};
    batch.count = 2;
    batch.mu = bad;
    CHECK(fclib_solve_batch(&batch) == 1);
    CHECK(status[0] == FCLIB_CONVERGED && status[1] == FCLIB_INVALID && isnan(r[3]));
    CHECK(fabs(r[0] - 0.5) < 1e-12 && isinf(error[1]));
    batch.status = NULL;
    CHECK(fclib_solve_batch(&batch) == 0 && strstr(fclib_last_error(), "problem 1: mu"));
    batch.status = status;
    batch.mu = NULL;
    CHECK(fclib_solve_batch(&batch) == 0 && strstr(fclib_last_error(), "batch->mu"));
    batch.mu = mu;
    batch.size = 8;
    CHECK(fclib_solve_batch(&batch) == 0 && strstr(fclib_last_error(), "batch->size"));
    CHECK(fclib_solve_batch(NULL) == 0);
    batch.size = sizeof batch;
    batch.mu = mu;
  }
  { /* W by blocks: two contacts without a block between them */
    const int starts[3] = {0, 1, 2}, columns[2] = {0, 1};
    double by_blocks[6];
    batch.count = 1;
    batch.nc_each = 2;
    batch.starts = starts;
    batch.columns = columns;
    batch.r = by_blocks;
    CHECK(fclib_solve_batch(&batch) == 1 && status[0] == FCLIB_CONVERGED);
    CHECK(fabs(by_blocks[0] - 0.5) < 1e-12 && fabs(by_blocks[4] + 0.25) < 1e-12);
    batch.columns = NULL;
    CHECK(fclib_solve_batch(&batch) == 0 && strstr(fclib_last_error(), "batch->columns"));
    { /* the second problem alone has a block */
      const int sparse[4] = {0, 0, 0, 1};
      batch.count = 2;
      batch.nc_each = 1;
      batch.starts = sparse;
      CHECK(fclib_solve_batch(&batch) == 0 && strstr(fclib_last_error(), "batch->columns"));
      batch.count = 1;
    }
    batch.starts = NULL;
  }
  { /* a body of mass 1/2 on the ground: M v = H r + f, rows of the Jacobian are z, x, y */
    const double M[9] = {0.5, 0, 0, 0, 0.5, 0, 0, 0, 0.5};
    const double jacobian[9] = {0, 0, 1, 1, 0, 0, 0, 1, 0};
    const double f[3] = {2.5, 0, -0.5};
    double v[3];
    batch.nc_each = 1;
    batch.n_each = 3;
    batch.M = M;
    CHECK(fclib_solve_batch(&batch) == 0 && strstr(fclib_last_error(), "batch->W"));
    batch.W = NULL;
    batch.H = jacobian;
    batch.f = f;
    batch.v = v;
    batch.r = r;
    CHECK(fclib_solve_batch(&batch) == 1 && status[0] == FCLIB_CONVERGED);
    CHECK(fabs(r[0] - 0.5) < 1e-12 && fabs(r[1] + 0.25) < 1e-12 && fabs(v[0] - 4.5) < 1e-12);
    CHECK(fabs(v[2]) < 1e-12 && fabs(u[1] - 4.5) < 1e-12);
  }
  { /* a contact that spins at the limit of its moment: m_N = -mu_s r_N */
    const double unit[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    const double turning[4] = {-1, 0, 0, 5};
    const double sliding = 0.5, spin = 0.1;
    struct fclib_batch other;
    double moments[4];
    memset(&other, 0, sizeof other);
    other.size = sizeof other;
    other.spacedim = 4;
    other.count = 1;
    other.nc_each = 1;
    other.W = unit;
    other.q = turning;
    other.mu = &sliding;
    other.r = moments;
    CHECK(fclib_solve_batch(&other) == 0 && strstr(fclib_last_error(), "spacedim"));
    other.mu_s = &spin;
    CHECK(fclib_solve_batch(&other) == 1);
    CHECK(fabs(moments[0] - 1) < 1e-7 && fabs(moments[3] + 0.1) < 1e-7);
  }
  { /* the second contact slides: r_T = -mu r_N, r_N = -q_N / 2 */
    struct fclib_derivatives by;
    double dq[6] = {0, 0, 0, 1, 0, 0}, dmu[2] = {0, 0}, dr[6], du[6], dW[18];
    unsigned char unique[2], degenerate[2];
    memset(&by, 0, sizeof by);
    CHECK(fclib_batch_jvp(&by) == 0 && strstr(fclib_last_error(), "derivatives->size"));
    by.size = sizeof by;
    by.spacedim = 3;
    by.count = 2;
    by.nc_each = 1;
    by.W = W;
    by.q = q;
    by.mu = mu;
    batch.M = NULL;
    batch.W = W;
    batch.count = 2;
    CHECK(fclib_solve_batch(&batch) == 1);
    by.r = r;
    by.dq = dq;
    by.dr = dr;
    by.du = du;
    by.unique = unique;
    by.degenerate = degenerate;
    CHECK(fclib_batch_jvp(&by) == 1);
    CHECK(dr[0] == 0 && fabs(dr[3] + 0.5) < 1e-12 && fabs(dr[4] - 0.25) < 1e-12);
    CHECK(fabs(du[4] - 0.5) < 1e-12 && unique[0] && unique[1] && !degenerate[1]);
    memset(dr, 0, sizeof dr);
    dr[4] = 1; /* the derivatives of r_T of the second */
    by.du = NULL;
    by.dmu = dmu;
    by.dW = dW;
    by.threads = -1;
    CHECK(fclib_batch_vjp(&by) == 1);
    CHECK(fabs(dq[3] - 0.25) < 1e-12 && fabs(dmu[1] + 0.5) < 1e-12 && dmu[0] == 0);
    CHECK(fabs(dW[9] - 0.125) < 1e-12 && dW[0] == 0);
    by.r = NULL;
    CHECK(fclib_batch_vjp(&by) == 0 && strstr(fclib_last_error(), "derivatives->r"));
  }
  return 0;
}
