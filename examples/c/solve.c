/* Reads a local problem, solves it, and prints the solution: solve FILE [SOLVER]. */
#include <fclib.h>
#include <stdio.h>
#include <stdlib.h>

static int fail(const char* what) {
  fprintf(stderr, "%s failed\n", what); /* the library has said why */
  return 1;
}

int main(int argc, char** argv) {
  if (argc < 2) return fprintf(stderr, "usage: %s FILE [SOLVER]\n", argv[0]), 2;

  struct fclib_local* problem = fclib_read_local(argv[1]);
  if (!problem) return fail("reading");
  const int d = problem->spacedim, m = problem->W->m, nc = m / d;
  const int p = problem->R ? problem->R->m : 0;
  printf("%s: %d contacts in %d dimensions\n",
         problem->info && problem->info->title ? problem->info->title : argv[1], nc, d);

  /* calloc of at least one entry: a problem may have no contact, and no bilateral constraint */
  double* u = calloc((size_t)m + 1, sizeof *u);
  double* r = calloc((size_t)m + 1, sizeof *r);
  double* l = calloc((size_t)p + 1, sizeof *l);
  struct fclib_solution solution = {NULL, u, r, l};
  struct fclib_solve_options options = {0};
  options.tolerance = 1e-10;
  options.time_limit = 10; /* seconds */
  struct fclib_solve_result result;

  int ok = u && r && l &&
           fclib_solve_local(problem, argc > 2 ? argv[2] : fclib_solver_name(0), &options,
                             &solution, &result);
  if (ok) {
    printf("%s after %d iterations, error %.1e\n", fclib_status_name(result.status),
           result.iterations, result.error);
    for (int contact = 0; contact < nc && contact < 10; contact++) {
      printf("contact %d: r =", contact);
      for (int k = 0; k < d; k++) printf(" %g", r[d * contact + k]);
      printf("\n");
    }
  } else {
    fail("solving");
  }

  free(u);
  free(r);
  free(l);
  fclib_delete_local(problem);
  free(problem);
  return ok ? 0 : 1;
}
