/* Records a simulation in one file, step by step, and reads it back: sequence FILE. A ball of 1 kg
 * slides on a plane until friction stops it. */
#include <fclib.h>
#include <stdio.h>
#include <stdlib.h>

static int fail(const char* what) {
  fprintf(stderr, "%s failed\n", what); /* the library has said why */
  return 1;
}

int main(int argc, char** argv) {
  if (argc < 2) return fprintf(stderr, "usage: %s FILE\n", argv[0]), 2;
  enum { steps = 100 };
  const double dt = 0.01, g = 9.81;
  int columns[] = {0, 1, 2, 3}, rows[] = {0, 1, 2};
  double inverse_mass[] = {1, 1, 1}, velocity[] = {0, 2, 0}, q[3], u[3], r[3], mu[] = {0.5};
  struct fclib_matrix W = {3, 3, 3, columns, rows, inverse_mass, -1, NULL};
  struct fclib_local problem = {&W, NULL, NULL, mu, q, NULL, 3, NULL};
  struct fclib_solution solution = {NULL, u, r, NULL};

  struct fclib_sequence* sequence = fclib_sequence_create(argv[1], NULL);
  if (!sequence) return fail("the file");
  for (int k = 0; k < steps; k++) {
    for (int i = 0; i < 3; i++) q[i] = velocity[i];
    q[0] -= g * dt;
    struct fclib_solve_result result;
    if (!fclib_solve_local(&problem, "auto", NULL, &solution, &result)) return fail("the solve");
    if (!fclib_sequence_add_local(sequence, &problem, 0)) return fail("the step");
    if (!fclib_sequence_add_solution(sequence, &solution)) return fail("the solution");
    for (int i = 0; i < 3; i++) velocity[i] = u[i];
  }
  if (!fclib_sequence_close(sequence)) return fail("the end");

  /* each step is a file to all functions that read */
  printf("%d steps\n", fclib_sequence_size(argv[1]));
  for (int k = 0; k < steps; k += 20) {
    char path[4096];
    snprintf(path, sizeof path, "%s#%d", argv[1], k);
    struct fclib_local* read = fclib_read_local(path);
    struct fclib_solution* found = fclib_read_solution(path);
    if (!read || !found) return fail("reading");
    printf("step %d: slides with %.2f m/s, error %.0e\n", k, found->u[1],
           fclib_merit_local(read, MERIT_2, found));
    fclib_delete_solutions(found, 1);
    fclib_delete_local(read);
    free(read);
  }
  return 0;
}
