/* A solver of one's own, for fclib to load: projected Gauss-Seidel, one projection for each
 * contact.
 *
 *   cc -O2 -shared -fPIC pgs.c -o libpgs.so -lm
 *   fclib solve problem.hdf5 --solver plugin:./libpgs.so --option step=0.5
 */
#include <fclib_plugin.h>
#include <math.h>
#include <stddef.h>

static const struct fclib_plugin_option options[] = {
    {"step", "float", "1", "1", "length of the steps, by the mean of a contact's mobility", NULL,
     0.01, 2},
    {NULL, NULL, NULL, NULL, NULL, NULL, 0, 0}};
static const struct fclib_plugin_about about = {
    sizeof about, 1, "Projected Gauss-Seidel, one projection for each contact", NULL, options};

const struct fclib_plugin_about* fclib_plugin_describe(void) { return &about; }

/* onto the disc of this radius */
static void project(double* x, int count, double radius) {
  double square = 0;
  for (int k = 0; k < count; k++) square += x[k] * x[k];
  const double length = sqrt(square);
  for (int k = 0; k < count && length > radius; k++) x[k] *= radius / length;
}

int fclib_plugin_solve(const struct fclib_plugin_problem* problem, double* r) {
  const int d = problem->spacedim, rolling = problem->mu_r != NULL;
  const int tangential = rolling ? (d - 1) / 2 : d - 1; /* and as many of rolling */
  const double step = d * problem->number(problem->context, "step");
  do {
    for (int contact = 0; contact < problem->contacts; contact++) {
      double* own = r + contact * d;
      double u[5] = {0}, trace = 0;
      for (int k = 0; k < d; k++) {
        const int row = contact * d + k;
        u[k] = problem->q[row];
        for (int e = problem->start[row]; e < problem->start[row + 1]; e++) {
          u[k] += problem->value[e] * r[problem->column[e]];
          if (problem->column[e] == row) trace += problem->value[e];
        }
      }
      if (trace <= 0) return 1; /* a contact that moves nothing is not for this solver */

      /* a step against the velocity, onto the half line and then onto the discs */
      for (int k = 0; k < d; k++) own[k] -= step / trace * u[k];
      own[0] = fmax(own[0], 0);
      project(own + 1, tangential, problem->mu[contact] * own[0]);
      if (rolling) project(own + 1 + tangential, tangential, problem->mu_r[contact] * own[0]);
    }
  } while (!problem->stop(problem->context, r));
  return 0;
}
