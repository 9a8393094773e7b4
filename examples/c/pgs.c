/* Projected Gauss-Seidel, a solver that fclib runs as a program: pgs FILE [TOL [MAX_SWEEPS]]
 *
 *     fclib solve --solver "cmd:./pgs {input} {tol}" FILE...
 *
 * Reads a local problem without bilateral constraints, starts from its guess where there is one,
 * and adds the solution to the file. It need not judge itself well: fclib does.
 */
#include <fclib.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int fail(const char* what) {
  fprintf(stderr, "%s failed\n", what); /* the library has said why */
  return 1;
}

/* the rows of W, whatever its storage: dense, since this is an example */
static double* rows_of(const struct fclib_matrix* W) {
  const int m = W->m;
  double* rows = calloc((size_t)m * (size_t)m + 1, sizeof *rows);
  if (!rows) return NULL;
  if (W->nz == -3) {
    for (int j = 0; j < m; j++)
      for (int i = 0; i < m; i++) rows[i * m + j] = W->x[i + j * m];
  } else if (W->nz >= 0) {
    for (int k = 0; k < W->nz; k++) rows[W->i[k] * m + W->p[k]] += W->x[k];
  } else {
    for (int a = 0; a < m; a++) {
      for (int k = W->p[a]; k < W->p[a + 1]; k++) {
        if (W->nz == -1) rows[W->i[k] * m + a] += W->x[k];
        if (W->nz == -2) rows[a * m + W->i[k]] += W->x[k];
      }
    }
  }
  return rows;
}

/* the point of the cone ||x_T|| <= mu x_N that is nearest to x */
static void project(double* x, int d, double mu) {
  const double norm = d == 3 ? hypot(x[1], x[2]) : fabs(x[1]);
  if (norm <= mu * x[0]) return;
  const double normal = fmax(0, (x[0] + mu * norm) / (1 + mu * mu));
  for (int k = 1; k < d; k++) x[k] *= norm > 0 ? mu * normal / norm : 0;
  x[0] = normal;
}

int main(int argc, char** argv) {
  if (argc < 2) return fprintf(stderr, "usage: %s FILE [TOL [MAX_SWEEPS]]\n", argv[0]), 2;
  const double tol = argc > 2 ? atof(argv[2]) : 1e-8;
  const long sweeps = argc > 3 ? atol(argv[3]) : 100000;

  struct fclib_local* problem = fclib_read_local(argv[1]);
  if (!problem || !fclib_validate_local(problem)) return fail("reading");
  if (problem->R) return fprintf(stderr, "bilateral constraints are not for this solver\n"), 1;
  const int d = problem->spacedim, m = problem->W->m;
  double* W = rows_of(problem->W);
  double* u = calloc((size_t)m + 1, sizeof *u);
  double* r = calloc((size_t)m + 1, sizeof *r);
  if (!W || !u || !r) return fprintf(stderr, "no memory\n"), 1;

  int guesses = 0;
  struct fclib_solution* guess = fclib_read_guesses(argv[1], &guesses);
  if (guess) memcpy(r, guess->r, (size_t)m * sizeof *r);
  fclib_delete_solutions(guess, guesses);

  for (long sweep = 0; sweep < sweeps; sweep++) {
    double change = 0, size = 0;
    for (int a = 0; a < m; a += d) {
      double x[3], trace = 0;
      for (int k = 0; k < d; k++) {
        u[a + k] = problem->q[a + k];
        for (int j = 0; j < m; j++) u[a + k] += W[(a + k) * m + j] * r[j];
        trace += W[(a + k) * m + a + k];
      }
      /* u^ = u + [mu ||u_T||, 0, 0], and a step that is safe: 1 / trace */
      const double mu = problem->mu[a / d], rho = trace > 0 ? 1 / trace : 1;
      const double slip = mu * (d == 3 ? hypot(u[a + 1], u[a + 2]) : fabs(u[a + 1]));
      for (int k = 0; k < d; k++) x[k] = r[a + k] - rho * (u[a + k] + (k == 0 ? slip : 0));
      project(x, d, mu);
      for (int k = 0; k < d; k++) {
        change += (x[k] - r[a + k]) * (x[k] - r[a + k]) / (rho * rho);
        size += problem->q[a + k] * problem->q[a + k];
        r[a + k] = x[k];
      }
    }
    if (sqrt(change) <= 0.1 * tol * (size > 0 ? sqrt(size) : 1)) break;
  }
  for (int i = 0; i < m; i++) {
    u[i] = problem->q[i];
    for (int j = 0; j < m; j++) u[i] += W[i * m + j] * r[j];
  }

  struct fclib_solution solution = {NULL, u, r, NULL};
  const int ok = fclib_write_solution(&solution, argv[1]);
  if (!ok) fail("writing");
  free(W);
  free(u);
  free(r);
  fclib_delete_local(problem);
  free(problem);
  return ok ? 0 : 1;
}
