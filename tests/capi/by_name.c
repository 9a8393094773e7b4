/* What goes by name, and what is converted; ends with 0 where it holds.
 *
 *   by_name FOLDER
 */
#include "checks.h"

/* two balls on a plane, one of them pushed against the other: nsgs needs some sweeps */
static int columns[] = {0, 2, 3, 4, 6, 7, 8}, rows[] = {0, 3, 1, 2, 0, 3, 4, 5};
static double x[] = {2, 1, 2, 2, 1, 2, 2, 2};
static struct fclib_matrix W = {8, 6, 6, columns, rows, x, -1, NULL};
static int each[] = {0, 1, 2, 3, 4, 5, 6};
static double mass[] = {2, 2, 2, 2, 2, 2}, ones[] = {1, 1, 1, 1, 1, 1};
static struct fclib_matrix M = {6, 6, 6, each, each, mass, -1, NULL};
static struct fclib_matrix H = {6, 6, 6, each, each, ones, -1, NULL};
static double q[] = {-1, 2, 0, -2, 0.1, 0}, mu[] = {0.5, 0.3};

static struct fclib_local local(void) { return local_of(&W, q, mu); }
static struct fclib_global global(void) { return global_of(&M, &H, q, mu); }

static int told;
static int tell(int iteration, double error, double time, const char* stage, void* context) {
  CHECK(iteration >= 0 && error >= 0 && time >= 0 && stage);
  return ++told == *(int*)context;
}

static void solving(void) {
  struct fclib_local a = local();
  struct fclib_options* o = fclib_options_create();
  int count = 0, never = -1, at_once = 1;
  CHECK(o);
  CHECK(fclib_options_set_text(o, "solver", "nsgs"));
  CHECK(fclib_options_set_number(o, "tolerance", 1e-12));
  CHECK(fclib_options_set_number(o, "max_iterations", 1e6)); /* not "1e+06" */
  CHECK(fclib_options_set_progress(o, tell, &never));
  struct fclib_report* all = fclib_solve_local_with(&a, o);
  CHECK(all && !strcmp(fclib_report_text(all, "status"), "converged"));
  CHECK(fclib_report_number(all, "status") == FCLIB_CONVERGED && told > 1);
  CHECK(!strcmp(fclib_report_text(all, "solver"), "nsgs"));
  CHECK(fclib_report_number(all, "error") <= 1e-12 && fclib_report_number(all, "iterations") >= 2);
  const double* r = fclib_report_array(all, "r", &count);
  CHECK(r && count == 6 && r[0] > 0);
  CHECK(fclib_report_array(all, "l", &count) && count == 0);
  CHECK(isnan(fclib_report_number(all, "no_such")));
  SAYS("certificate_bound");
  CHECK(!fclib_report_text(all, "error") && !fclib_report_array(all, "no_such", &count));

  /* the parts of its merit, and of a wrong one */
  double reactions[6];
  memcpy(reactions, r, sizeof reactions);
  struct fclib_solution s = {NULL, NULL, reactions, NULL};
  struct fclib_report* parts = fclib_judge_local(&a, &s);
  CHECK(parts && fclib_report_number(parts, "error") == fclib_merit_local(&a, MERIT_2, &s));
  CHECK(fclib_report_number(parts, "slide") + fclib_report_number(parts, "stick") == 2);
  fclib_report_delete(parts);
  s.r = NULL;
  CHECK(!fclib_judge_local(&a, &s));
  s.r = reactions;

  /* the callback ends it */
  told = 0;
  CHECK(fclib_options_set_progress(o, tell, &at_once));
  struct fclib_report* cut = fclib_solve_local_with(&a, o);
  CHECK(cut && fclib_report_number(cut, "status") == FCLIB_INTERRUPTED && told == 1);
  CHECK(fclib_report_number(cut, "error") > 1e-12);
  fclib_report_delete(cut);
  CHECK(fclib_options_set_progress(o, NULL, NULL));

  /* a guess, and what is wrong */
  CHECK(fclib_options_set_array(o, "guess", reactions, 6));
  struct fclib_report* again = fclib_solve_local_with(&a, o);
  CHECK(again && fclib_report_number(again, "iterations") <= 1);
  fclib_report_delete(again);
  CHECK(fclib_options_set_array(o, "guess", reactions, 5) && !fclib_solve_local_with(&a, o));
  SAYS("expected 6");
  CHECK(!fclib_options_set_array(o, "guess", NULL, 6) &&
        !fclib_options_set_array(o, "guess", reactions, -1));
  CHECK(fclib_options_set_array(o, "gues", reactions, 6) && !fclib_solve_local_with(&a, o));
  fclib_options_delete(o);
  const char* wrong[][3] = {
      {"tolerance", "-1", "outside"},         {"tolerance", "inf", "not a number"},
      {"tolerance", "small", "not a number"}, {"merit", "mine", "both, natural"},
      {"solver", "no_such", "no_such"},       {"tolerence", "1", "tolerence"}};
  for (unsigned k = 0; k < sizeof wrong / sizeof *wrong; k++) {
    o = fclib_options_create();
    CHECK(fclib_options_set_text(o, wrong[k][0], wrong[k][1]) && !fclib_solve_local_with(&a, o));
    SAYS(wrong[k][2]);
    fclib_options_delete(o);
  }
  CHECK(!fclib_options_set_text(NULL, "a", "b") && !fclib_solve_local_with(NULL, NULL));
  fclib_report_delete(all);
  all = fclib_solve_local_with(&a, NULL);
  CHECK(all && !strcmp(fclib_report_text(all, "solver"), "auto"));
  fclib_report_delete(all);
  fclib_options_delete(NULL);
  fclib_report_delete(NULL);
}

static void lists(void) {
  int found = 0;
  for (int k = 0; fclib_solver_name(k); k++) {
    const char* solver = fclib_solver_name(k);
    CHECK(*fclib_solver_text(solver, "title") && fclib_solver_text(solver, "family"));
    for (int j = 0; fclib_option_text(solver, j, "name"); j++) {
      CHECK(*fclib_option_text(solver, j, "name") && *fclib_option_text(solver, j, "doc"));
      const char* type = fclib_option_text(solver, j, "type");
      if (!strcmp(type, "choice")) CHECK(strstr(fclib_option_text(solver, j, "choices"), ", "));
      CHECK(fclib_option_text(solver, j, "default"));
      found++;
    }
    CHECK(!*fclib_last_error()); /* the end is no error */
  }
  CHECK(found > 20);
  CHECK(!fclib_option_text("no_such", 0, "name") && !fclib_option_text("nsgs", 0, "no_such"));
  CHECK(!fclib_solver_text("nsgs", "no_such"));
  SAYS("title");
}

static void converting(void) {
  struct fclib_global a = global();
  struct fclib_local* b = fclib_condense_global(&a);
  CHECK(b && b->W->m == 6);
  CHECK(!b->V);
  CHECK(!b->info);
  CHECK(fabs(b->q[1] - 1) < 1e-15 && b->mu[1] == 0.3);
  struct fclib_report* done = fclib_solve_local_with(b, NULL);
  int count = 0;
  double u[6], v[6], r[6];
  memcpy(r, fclib_report_array(done, "r", &count), sizeof r);
  struct fclib_solution s = {v, u, r, NULL};
  CHECK(fclib_complete_global(&a, &s) && fclib_merit_global(&a, MERIT_2, &s) <= 1e-8);
  CHECK(fabs(u[0] - (r[0] + q[0]) / 2) < 1e-15 && v[4] == u[4]);
  s.v = NULL; /* it need not be there */
  CHECK(fclib_complete_local(b, &s));
  s.r = NULL;
  CHECK(!fclib_complete_local(b, &s));
  fclib_report_delete(done);

  CHECK(fclib_write_siconos_local(b, path_of("ball.dat")));
  struct fclib_local* text = fclib_read_siconos_local(path_of("ball.dat"));
  CHECK(text && text->q[3] == b->q[3] && text->W->m == 6);
  CHECK(!fclib_read_siconos_global(path_of("ball.dat")) && !fclib_read_siconos_local("missing"));
  fclib_delete_local(text);
  free(text);
  fclib_delete_local(b);
  free(b);
  mass[5] = 0;
  CHECK(!fclib_condense_global(&a));
  SAYS("M is not positive definite");
  mass[5] = 2;
}

static void writing(void) {
  struct fclib_local a = local();
  const char* path = path_of("ball.hdf5");
  struct fclib_options* o = fclib_options_create();
  CHECK(fclib_options_set_number(o, "compression", 9));
  CHECK(fclib_write_local_with(&a, path, o) && !fclib_write_local_with(&a, path, o));
  CHECK(fclib_options_set_text(o, "mode", "replace") && fclib_write_local_with(&a, path, o));
  CHECK(!fclib_write_local_with(&a, path, NULL)); /* of the process: nothing has changed there */
  int n = -1, m = -1, p = -1, nc = -1;
  CHECK(fclib_problem_sizes(path, &n, &m, &p, &nc) && n == 0 && m == 6 && p == 0 && nc == 2);
  CHECK(fclib_problem_sizes(path, NULL, &m, NULL, NULL) &&
        !fclib_problem_sizes("none", 0, 0, 0, 0));

  double r[6] = {1};
  struct fclib_solution s = {NULL, NULL, r, NULL};
  CHECK(fclib_write_solution_with(&s, path, NULL) && !fclib_write_solution_with(&s, path, NULL));
  CHECK(fclib_write_solution_with(&s, path, o) && fclib_write_guesses_with(1, &s, path, NULL));
  CHECK(!fclib_write_guesses_with(1, &s, path, NULL) && fclib_write_guesses_with(1, &s, path, o));
  CHECK(fclib_options_set_number(o, "compression", 10) && !fclib_write_local_with(&a, path, o));
  SAYS("10");
  CHECK(fclib_options_set_number(o, "compression", 1) && fclib_options_set_number(o, "level", 1));
  CHECK(!fclib_write_local_with(&a, path, o));
  SAYS("mode, compression");
  fclib_options_delete(o);
}

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  snprintf(folder, sizeof folder, "%s", argv[1]);
  fclib_set_error_handler(NULL, NULL);
  solving();
  lists();
  converting();
  writing();
  return 0;
}
