/* Writes a problem from scratch: a ball of 1 kg that falls on a plane while it slides, and its
 * solution: write FILE. */
#include <fclib.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static int fail(const char* what) {
  fprintf(stderr, "%s failed\n", what); /* the library has said why */
  return 1;
}

int main(int argc, char** argv) {
  if (argc < 2) return fprintf(stderr, "usage: %s FILE\n", argv[0]), 2;

  /* W = 1 / mass, by columns; without reactions the ball would go down and along */
  int columns[] = {0, 1, 2, 3}, rows[] = {0, 1, 2};
  double inverse_mass[] = {1, 1, 1};
  struct fclib_matrix W = {3, 3, 3, columns, rows, inverse_mass, -1, NULL};
  double q[] = {-1, 2, 0}, mu[] = {0.5};
  struct fclib_info info = {"a ball on a plane", "one contact, sliding", "one solution"};
  struct fclib_local problem = {0};
  problem.W = &W;
  problem.q = q;
  problem.mu = mu;
  problem.spacedim = 3;
  problem.info = &info;
  if (!fclib_validate_local(&problem)) return fail("the problem");

  /* it stops falling, r_N = 1, and friction slows it by mu r_N */
  double u[] = {0, 1.5, 0}, r[] = {1, -0.5, 0};
  struct fclib_solution solution = {NULL, u, r, NULL};
  const double error = fclib_merit_local(&problem, MERIT_2, &solution);
  if (isnan(error)) return fail("the merit");
  printf("error %.1e\n", error);

  fclib_set_write_mode(FCLIB_WRITE_REPLACE); /* the file may be there from the last time */
  if (!fclib_write_local(&problem, argv[1])) return fail("writing");
  if (!fclib_write_solution(&solution, argv[1])) return fail("writing");
  fclib_create_int_attributes_in_info(argv[1], "number_of_contacts", 1);
  printf("wrote a %s problem\n", fclib_problem_kind(argv[1]));
  return 0;
}
