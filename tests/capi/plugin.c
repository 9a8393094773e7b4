/* A solver in a shared object, named like the others; ends with 0 where it holds.
 *
 *   plugin PROBLEM plugin:LIBPGS
 */
#include "check.h"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  fclib_set_error_handler(NULL, NULL);
  const char* name = argv[2];
  struct fclib_local* problem = fclib_read_local(argv[1]);
  CHECK(problem);
  double* r = calloc((size_t)problem->W->m, sizeof *r);
  struct fclib_solution solution = {NULL, NULL, r, NULL};
  struct fclib_solve_options options = {0};
  struct fclib_solve_result result;

  CHECK(fclib_solve_local(problem, name, NULL, &solution, &result));
  CHECK(result.status == FCLIB_CONVERGED && result.iterations > 0);
  const int iterations = result.iterations;
  options.options = "step=0.5";
  CHECK(fclib_solve_local(problem, name, &options, &solution, &result));
  CHECK(result.status == FCLIB_CONVERGED && result.iterations != iterations);
  options.options = "step=7";
  CHECK(!fclib_solve_local(problem, name, &options, &solution, &result));
  SAYS("7 is outside [0.01, 2]");

  CHECK(strstr(fclib_solver_text(name, "title"), "Projected Gauss-Seidel"));
  CHECK(!strcmp(fclib_option_text(name, 0, "name"), "step"));
  CHECK(!fclib_option_text(name, 1, "name"));
  CHECK(!fclib_solve_local(problem, "plugin:./none.so", NULL, &solution, &result));
  SAYS("there is no such file");
  CHECK(!fclib_solve_local(problem, "plugin:", NULL, &solution, &result));

  free(r);
  fclib_delete_local(problem);
  free(problem);
  return 0;
}
