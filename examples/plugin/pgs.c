/* A solver of one's own, for fclib to load: projected Gauss-Seidel, one projection for each
 * contact.
 *
 *   cc -O2 -shared -fPIC pgs.c -o libpgs.so -lm
 *   fclib solve problem.hdf5 --solver plugin:./libpgs.so
 */
#include <fclib_plugin.h>
#include <math.h>

int fclib_plugin_solve(const struct fclib_plugin_problem* problem, double* r) {
  const int d = problem->spacedim;
  do {
    for (int contact = 0; contact < problem->contacts; contact++) {
      double* own = r + contact * d;
      double u[3] = {0, 0, 0}, trace = 0, tangential = 0;
      for (int k = 0; k < d; k++) {
        const int row = contact * d + k;
        u[k] = problem->q[row];
        for (int e = problem->start[row]; e < problem->start[row + 1]; e++) {
          u[k] += problem->value[e] * r[problem->column[e]];
          if (problem->column[e] == row) trace += problem->value[e];
        }
      }
      if (trace <= 0) return 1; /* a contact that moves nothing is not for this solver */

      /* a step against the velocity, onto the half line and then onto the disc */
      for (int k = 0; k < d; k++) own[k] -= d / trace * u[k];
      own[0] = fmax(own[0], 0);
      for (int k = 1; k < d; k++) tangential += own[k] * own[k];
      const double most = problem->mu[contact] * own[0], length = sqrt(tangential);
      for (int k = 1; k < d && length > most; k++) own[k] *= most / length;
    }
  } while (!problem->stop(problem->context, r));
  return 0;
}
