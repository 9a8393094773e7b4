/* What the interface promises beyond the layout of files; ends with 0 where it holds.
 *
 *   checks FOLDER
 */
#include "checks.h"

#include <limits.h>

/* one contact of a ball on a plane, sliding */
static int columns[] = {0, 1, 2, 3, 4, 5, 6}, rows[] = {0, 1, 2, 3, 4, 5};
static double one[] = {1, 1, 1, 1, 1, 1};
static struct fclib_matrix identity = {3, 3, 3, columns, rows, one, -1, NULL};
static double q[] = {-1, 2, 0}, mu[] = {0.5};
static double u[] = {0, 1.5, 0}, r[] = {1, -0.5, 0}, v[] = {0, 1.5, 0};
static struct fclib_local local(void) { return local_of(&identity, q, mu); }
static struct fclib_global global(void) { return global_of(&identity, &identity, q, mu); }

static void errors(void) {
  struct fclib_local a = local();
  struct fclib_solution s = {NULL, u, r, NULL};
  int count = 7;
  CHECK(!fclib_read_local(path_of("missing")));
  SAYS("there is no such file");
  SAYS("missing");
  CHECK(!fclib_read_local(folder));
  SAYS("is a directory");
  CHECK(!fclib_read_global(NULL));
  SAYS("is NULL");
  CHECK(!fclib_read_solution(path_of("missing")));
  CHECK(!fclib_read_guesses(path_of("missing"), &count) && count == 0);
  CHECK(!fclib_problem_kind(path_of("missing")));
  CHECK(!fclib_write_local(&a, folder));
  CHECK(!fclib_write_local(&a, path_of("no/such/folder")));
  CHECK(!fclib_write_local(NULL, path_of("a")));
  CHECK(!fclib_write_solution(&s, path_of("missing")));
  CHECK(!fclib_create_int_attributes_in_info(path_of("missing"), "a", 1));

  FILE* text = fopen(path_of("text"), "w");
  fputs("not HDF5\n", text);
  fclose(text);
  CHECK(!fclib_read_local(path_of("text")));
  SAYS("is not an HDF5 file");
  CHECK(!fclib_write_local(&a, path_of("text")));

  /* what a problem lacks, or says wrongly */
  a.q = NULL;
  CHECK(!fclib_write_local(&a, path_of("a")));
  SAYS("/fclib_local/vectors/q");
  a = local();
  a.spacedim = 4;
  CHECK(!fclib_write_local(&a, path_of("a")));
  SAYS("spacedim");
  a.spacedim = 2;
  CHECK(!fclib_write_local(&a, path_of("a")));
  SAYS("no multiple");
  a = local();
  a.V = &identity;
  CHECK(!fclib_write_local(&a, path_of("a")));
  struct fclib_matrix bad = identity;
  bad.nz = -7;
  a = local();
  a.W = &bad;
  CHECK(!fclib_write_local(&a, path_of("a")));
  SAYS("is no storage");
  CHECK(!fclib_read_local(path_of("a")));

  /* a layer over the library adds messages of its own */
  fclib_set_error("mine");
  CHECK(!strcmp(fclib_last_error(), "mine"));
  fclib_set_error(NULL);
  SAYS("is NULL");

  /* a success clears the message */
  a = local();
  CHECK(fclib_write_local(&a, path_of("a")));
  CHECK(!*fclib_last_error());
  CHECK(!fclib_read_global(path_of("a")));
  SAYS("holds no global problem; it holds: local");
  CHECK(!fclib_read_solution(path_of("a")));
  CHECK(!fclib_read_guesses(path_of("a"), &count) && count == 0);
  CHECK(!*fclib_last_error()); /* that there are none is no error */

  /* nothing to delete */
  fclib_delete_local(NULL);
  fclib_delete_global(NULL);
  fclib_delete_local_rolling(NULL);
  fclib_delete_global_rolling(NULL);
  fclib_delete_solutions(NULL, 3);
  struct fclib_local empty = {0};
  fclib_delete_local(&empty);
}

static void version(void) {
  char header[32];
  snprintf(header, sizeof header, "%d.%d.%d", FCLIB_VERSION_MAJOR, FCLIB_VERSION_MINOR,
           FCLIB_VERSION_PATCH);
  CHECK(!strcmp(fclib_version(), header));
}

static int told;
static void handler(const char* message, void* context) {
  CHECK(strstr(message, "missing") && context == &told);
  told++;
}

static void handlers(void) {
  fclib_set_error_handler(handler, &told);
  CHECK(!fclib_read_local(path_of("missing")) && told == 1);
  fclib_set_error_handler(NULL, NULL);
  CHECK(!fclib_read_local(path_of("missing")) && told == 1);
}

static void modes(void) {
  struct fclib_local a = local();
  struct fclib_global b = global();
  struct fclib_solution s = {v, u, r, NULL}, *read, guesses[] = {s, s};
  const char* path = path_of("modes");
  int count;
  CHECK(fclib_write_local(&a, path));
  CHECK(!strcmp(fclib_problem_kind(path), "local"));
  CHECK(!fclib_write_local(&a, path));
  SAYS("is in the file already");
  CHECK(fclib_write_global(&b, path));
  CHECK(!strcmp(fclib_problem_kind(path), "global"));
  CHECK(fclib_write_solution(&s, path));
  CHECK(!fclib_write_solution(&s, path));
  CHECK(fclib_write_guesses(2, guesses, path));
  CHECK(!fclib_write_guesses(2, guesses, path));
  CHECK(fclib_create_int_attributes_in_info(path, "number", 1));
  CHECK(!fclib_create_int_attributes_in_info(path, "number", 2));
  CHECK((read = fclib_read_guesses(path, &count)) && count == 2 && read[1].v[1] == 1.5);
  fclib_delete_solutions(read, count);

  CHECK(!fclib_set_write_mode((enum fclib_write_mode)9));
  CHECK(fclib_set_write_mode(FCLIB_WRITE_REPLACE));
  double other[] = {0, 0, 0};
  s.u = other;
  CHECK(fclib_write_solution(&s, path));
  CHECK(fclib_write_guesses(1, guesses, path));
  CHECK(fclib_create_int_attributes_in_info(path, "number", 2));
  CHECK((read = fclib_read_solution(path)) && read->u[1] == 0);
  fclib_delete_solutions(read, 1);
  CHECK(fclib_write_global(&b, path));
  CHECK(!fclib_read_solution(path)); /* it was that of another problem */
  CHECK(fclib_set_write_mode(FCLIB_WRITE_ADD));

  CHECK(!fclib_set_compression(10));
  CHECK(!fclib_set_compression(-1));
  CHECK(fclib_set_compression(0));
  CHECK(fclib_write_local(&a, path_of("plain")));
  CHECK(fclib_set_compression(4));
}

static void validation_and_merits(void) {
  struct fclib_local a = local();
  struct fclib_global b = global();
  struct fclib_solution s = {NULL, u, r, NULL};
  CHECK(fclib_validate_local(&a) && fclib_validate_global(&b));
  CHECK(fclib_validate_local_solution(&a, &s));
  CHECK(fclib_merit_local(&a, MERIT_1, &s) == 0 && fclib_merit_local(&a, MERIT_2, &s) == 0);
  CHECK(fclib_merit_global(&b, MERIT_1, &s) == 0 && fclib_merit_global(&b, MERIT_2, &s) == 0);
  s.v = v;
  CHECK(fclib_merit_global(&b, MERIT_1, &s) == 0);
  double wrong[] = {2, 0, 0};
  s.r = wrong;
  s.v = s.u = NULL;
  CHECK(fclib_merit_local(&a, MERIT_1, &s) > 0.1 && fclib_merit_local(&a, MERIT_2, &s) > 0.1);
  /* without a residual of the dynamics, the global merit is that of the condensed problem */
  CHECK(fabs(fclib_merit_global(&b, MERIT_1, &s) - fclib_merit_local(&a, MERIT_1, &s)) < 1e-15);

  /* the same matrix in every storage */
  int row_pointers[] = {0, 1, 2, 3};
  double dense[] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  struct fclib_matrix others[] = {{3, 3, 3, row_pointers, rows, one, -2, NULL},
                                  {3, 3, 3, rows, rows, one, 3, NULL},
                                  {9, 3, 3, NULL, NULL, dense, -3, NULL}};
  for (int k = 0; k < 3; k++) {
    struct fclib_local other = local();
    other.W = &others[k];
    CHECK(fclib_merit_local(&other, MERIT_1, &s) == fclib_merit_local(&a, MERIT_1, &s));
    char name[] = "storage0";
    name[7] = (char)('0' + k);
    CHECK(fclib_write_local(&other, path_of(name)));
    CHECK(fclib_keep_dense(1));
    struct fclib_local* back = fclib_read_local(path_of(name));
    CHECK(fclib_keep_dense(0));
    CHECK(back && back->W->nz == others[k].nz && !back->V && !back->info);
    CHECK(fclib_merit_local(back, MERIT_2, &s) == fclib_merit_local(&a, MERIT_2, &s));
    fclib_delete_local(back);
    CHECK(!back->W && !back->q); /* a second time does no harm */
    fclib_delete_local(back);
    free(back);
  }

  /* a merit of what makes no sense is none; 3.1's writer takes it all the same */
  int outside[] = {0, 1, 5};
  struct fclib_matrix bad = identity;
  bad.i = outside;
  a.W = &bad;
  CHECK(!fclib_validate_local(&a));
  SAYS("/fclib_local/W/i[2]");
  CHECK(isnan(fclib_merit_local(&a, MERIT_1, &s)) && isnan(fclib_merit_local(&a, MERIT_2, &s)));
  CHECK(fclib_write_local(&a, path_of("outside")));
  struct fclib_local* back = fclib_read_local(path_of("outside"));
  CHECK(back && back->W->i[2] == 5);
  fclib_delete_local(back);
  free(back);

  /* pointers that were never set, though there are entries; room for one entry is what CSparse
   * gives a matrix of none */
  int unset[] = {0, 0, 0, 0};
  struct fclib_matrix pointless = identity;
  pointless.p = unset;
  a.W = &pointless;
  for (int nz = -2; nz < 0; nz++) {
    pointless.nz = nz;
    pointless.nzmax = 3;
    CHECK(!fclib_validate_local(&a));
    SAYS("/fclib_local/W/p: says that there is no entry");
    CHECK(isnan(fclib_merit_local(&a, MERIT_2, &s)));
    pointless.nzmax = 1;
    CHECK(fclib_validate_local(&a));
  }
  /* more entries than there is room for */
  struct fclib_matrix crowded = identity;
  crowded.p = crowded.i = unset;
  crowded.nz = INT_MAX;
  crowded.nzmax = 3;
  a.W = &crowded;
  CHECK(!fclib_validate_local(&a));
  SAYS("/fclib_local/W/nz: 2147483647 entries, more than nzmax, 3");
  a = local();
  wrong[1] = NAN;
  CHECK(!fclib_validate_local_solution(&a, &s));
  CHECK(isnan(fclib_merit_local(&a, MERIT_1, &s)));
  s.r = NULL;
  CHECK(!fclib_validate_local_solution(&a, &s) && isnan(fclib_merit_local(&a, MERIT_2, &s)));
  CHECK(isnan(fclib_merit_local(&a, (enum fclib_merit)5, &s)));
}

/* where bodies are: two balls on a plane and one on the other */
static void geometry(void) {
  struct fclib_local a = local();
  CHECK(fclib_write_local(&a, path_of("geometry")));
  int body[] = {0, 1}, moves[] = {0, 1}, kind[] = {FCLIB_PLANE, FCLIB_SPHERE};
  double point[] = {0, 0, 0}, normal[] = {0, 0, 1}, tangent[] = {1, 0, 0};
  double place[] = {0, 0, 0, 0, 0, 0.1}, size[] = {0, 0, 0, 0.1, 0, 0};
  const char* names[] = {"ground", "ball"};
  struct fclib_geometry g = {0};
  CHECK(!fclib_write_geometry(&g, path_of("geometry")));
  SAYS("geometry->size");
  g.size = sizeof g;
  CHECK(!fclib_write_geometry(&g, path_of("geometry")));
  SAYS("/contacts: has 0 rows, expected nc = 1");
  g.nc = 1;
  CHECK(!fclib_write_geometry(&g, path_of("geometry")));
  SAYS("/contacts/body: is NULL");
  g.body = body;
  g.point = point;
  g.normal = normal;
  g.tangent = tangent;
  CHECK(!fclib_write_geometry(&g, path_of("geometry")));
  SAYS("/contacts/body[0]: is 0, but there is none");
  g.nb = g.ns = 2;
  g.name = names;
  g.moves = moves;
  g.place = place;
  g.shape_kind = kind;
  g.shape_size = size;
  CHECK(fclib_write_geometry(&g, path_of("geometry")));
  CHECK(!fclib_write_geometry(&g, path_of("geometry")));
  SAYS("is in the file already");

  /* what contradicts itself, or the problem, is named, and not written */
  struct fclib_options* again = fclib_options_create();
  CHECK(fclib_options_set_text(again, "mode", "replace"));
  CHECK(fclib_write_geometry_with(&g, path_of("geometry"), again));

  /* masses, and what f is made of; a client that was compiled before has none */
  double mass[] = {0, 2}, inertia[] = {0, 0, 0, 0.1, 0.1, 0.1}, center[] = {0, 0, 0, 0, 0, 0},
         axes[] = {1, 0, 0, 0, 1, 0, 0, 0}, velocity[] = {0, 0, -1}, impulse[] = {0, 0, NAN};
  g.mass = mass;
  g.inertia = inertia;
  g.center = center;
  g.axes = axes;
  g.n = 3;
  g.velocity = velocity;
  g.impulse = impulse;
  CHECK(!fclib_write_geometry_with(&g, path_of("geometry"), again));
  SAYS("/bodies/impulse[2]: the value is not a finite number");
  g.size = offsetof(struct fclib_geometry, mass);
  CHECK(fclib_write_geometry_with(&g, path_of("geometry"), again));
  g.size = sizeof g;
  impulse[2] = -0.02;
  CHECK(fclib_write_geometry_with(&g, path_of("geometry"), again));
  body[1] = 2;
  CHECK(!fclib_write_geometry_with(&g, path_of("geometry"), again));
  SAYS("/contacts/body[1]: is 2, but must be 0 to 1");
  body[1] = 1;
  kind[1] = FCLIB_MESH;
  CHECK(!fclib_write_geometry_with(&g, path_of("geometry"), again));
  SAYS("/bodies/shape_mesh[1]: is -1, but the shape is a mesh");
  int mesh[] = {-1, 0}, first[] = {0, 0, 4, 4},
      face[] = {0, 2, 1, -1, 0, 1, 3, -1, 1, 2, 3, -1, 2, 0, 3, -1};
  double vertex[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  g.nm = 1;
  g.shape_mesh = mesh;
  g.mesh_first = first;
  g.vertex = vertex;
  g.face = face;
  CHECK(fclib_write_geometry_with(&g, path_of("geometry"), again));
  face[5] = 4;
  CHECK(!fclib_write_geometry_with(&g, path_of("geometry"), again));
  SAYS("/bodies/face[5]: is 4, but the mesh has 4 vertices");
  face[5] = -1;
  CHECK(!fclib_write_geometry_with(&g, path_of("geometry"), again));
  SAYS("/bodies/face[5]");
  face[5] = 1;
  first[2] = -1;
  CHECK(!fclib_write_geometry_with(&g, path_of("geometry"), again));
  SAYS("/bodies/mesh_first[2]");
  first[2] = 4;
  vertex[3] = NAN;
  CHECK(!fclib_write_geometry_with(&g, path_of("geometry"), again));
  SAYS("/bodies/vertex[3]: the value is not a finite number");
  names[0] = "two\nlines";
  CHECK(!fclib_write_geometry_with(&g, path_of("geometry"), again));
  SAYS("/bodies/name: name 0 has more than one line");
  CHECK(!fclib_write_geometry(NULL, path_of("geometry")));
  CHECK(!fclib_write_geometry(&g, NULL));
  fclib_options_delete(again);
}

/* many problems in one file */
static void sequence(void) {
  struct fclib_local a = local();
  struct fclib_global b = global();
  double r[] = {1, -0.5, 0}, half[] = {0.5, 0, 0};
  struct fclib_solution s = {NULL, NULL, r, NULL}, more[] = {s, {NULL, NULL, half, NULL}};
  char step[4200];

  CHECK(!fclib_sequence_create(NULL, NULL));
  CHECK(!fclib_sequence_continue(path_of("no_sequence")));
  CHECK(fclib_write_local(&a, path_of("no_steps")));
  CHECK(fclib_sequence_size(path_of("no_steps")) == -1);
  SAYS("is no sequence");
  CHECK(!fclib_sequence_continue(path_of("no_steps")));
  struct fclib_options* options = fclib_options_create();
  CHECK(fclib_options_set_number(options, "compression", 4));
  struct fclib_sequence* written = fclib_sequence_create(path_of("sequence"), options);
  fclib_options_delete(options);
  CHECK(written);
  CHECK(!fclib_sequence_create(path_of("sequence"), NULL));
  SAYS("another writer has it open");

  CHECK(!fclib_sequence_add_solution(written, &s));
  SAYS("sequence: has no step to add to: its problem comes first");
  CHECK(fclib_sequence_add_local(written, &a, 0));
  CHECK(fclib_sequence_add_solution(written, &s));
  CHECK(fclib_sequence_add_global(written, &b, 7));
  CHECK(fclib_sequence_add_guesses(written, 2, more));
  CHECK(!fclib_sequence_add_guesses(written, -1, more));
  int body[] = {0, 1}, moves[] = {0, 1};
  double point[] = {0, 0, 0}, normal[] = {0, 0, 1}, place[] = {0, 0, 0, 0, 0, 1};
  struct fclib_geometry g = {0};
  int shape[] = {-1, -1};
  g.size = sizeof g;
  g.nb = 2;
  g.body = body;
  g.shape = shape;
  g.moves = moves;
  g.point = g.normal = g.tangent = normal;
  g.point = point;
  g.place = place;
  CHECK(!fclib_sequence_add_geometry(written, &g));
  SAYS("/contacts: has 0 rows, expected nc = 1");
  g.nc = 1;
  CHECK(fclib_sequence_add_geometry(written, &g));
  CHECK(fclib_sequence_size(path_of("sequence")) <= 1);

  /* what belongs to a refused problem does not go into the step before */
  struct fclib_local bad = a;
  bad.q = NULL;
  for (int wrong = 0; wrong < 2; ++wrong) {
    CHECK(!fclib_sequence_add_local(written, wrong ? &a : &bad, wrong ? -1 : 0));
    CHECK(!fclib_sequence_add_solution(written, &s));
    SAYS("has no step to add to");
    CHECK(!fclib_sequence_add_guesses(written, 2, more));
    SAYS("has no step to add to");
    CHECK(!fclib_sequence_add_geometry(written, &g));
    SAYS("has no step to add to");
  }
  CHECK(fclib_sequence_flush(written));
  CHECK(fclib_sequence_size(path_of("sequence")) == 2);
  CHECK(!fclib_sequence_add_local(written, NULL, 0) && !fclib_sequence_add_local(NULL, &a, 0));
  CHECK(fclib_sequence_close(written) && fclib_sequence_close(NULL));

  /* each step is a file to what reads, and to nothing that writes */
  snprintf(step, sizeof step, "%s#0", path_of("sequence"));
  struct fclib_local* read = fclib_read_local(step);
  struct fclib_solution* found = fclib_read_solution(step);
  CHECK(read && found && found->r[1] == -0.5 && found->u[1] == 1.5 && !found->v);
  CHECK(!fclib_write_solution(found, step));
  SAYS("is a step of a sequence");
  fclib_delete_solutions(found, 1);
  fclib_delete_local(read);
  free(read);
  snprintf(step, sizeof step, "%s#1", path_of("sequence"));
  CHECK(!strcmp(fclib_problem_kind(step), "global") && !fclib_read_local(step));
  int count = 0;
  found = fclib_read_guesses(step, &count);
  CHECK(found && count == 2 && found[1].r[0] == 0.5 && found[1].v);
  CHECK(!fclib_read_solution(step));
  fclib_delete_solutions(found, 2);

  written = fclib_sequence_continue(path_of("sequence"));
  CHECK(written && fclib_sequence_add_local(written, &a, 7));
  CHECK(fclib_sequence_close(written));
  CHECK(fclib_sequence_size(path_of("sequence")) == 3);
}

static void rolling(void) {
  struct fclib_matrix five = {5, 5, 5, columns, rows, one, -1, NULL};
  double q5[] = {-1, 2, 0, 0.5, 0}, mu_r[] = {0.1};
  struct fclib_local_rolling a = {0};
  a.W = &five;
  a.q = q5;
  a.mu = mu;
  a.mu_r = mu_r;
  a.spacedim = 5;
  CHECK(fclib_validate_local_rolling(&a));
  CHECK(fclib_write_local_rolling(&a, path_of("rolling")));
  CHECK(!strcmp(fclib_problem_kind(path_of("rolling")), "local_rolling"));
  struct fclib_local_rolling* back = fclib_read_local_rolling(path_of("rolling"));
  CHECK(back && back->mu_r[0] == 0.1 && back->spacedim == 5);

  /* it stops falling; friction slows sliding by mu, rolling by mu_r */
  double r5[] = {1, -0.5, 0, -0.1, 0}, u5[] = {0, 1.5, 0, 0.4, 0};
  struct fclib_solution s = {NULL, u5, r5, NULL};
  CHECK(fclib_validate_local_rolling_solution(back, &s));
  CHECK(fclib_merit_local_rolling(back, MERIT_1, &s) < 1e-15);
  CHECK(fclib_merit_local_rolling(back, MERIT_2, &s) < 1e-15);
  CHECK(fclib_write_solution(&s, path_of("rolling")));
  fclib_delete_local_rolling(back);
  free(back);
}

static void spin(void) {
  struct fclib_matrix four = {4, 4, 4, columns, rows, one, -1, NULL};
  double q4[] = {-1, 2, 0, 0.5}, mu_s[] = {0.1};
  struct fclib_local_spin a = {0};
  a.W = &four;
  a.q = q4;
  a.mu = mu;
  a.mu_s = mu_s;
  a.spacedim = 4;
  CHECK(fclib_validate_local_spin(&a));
  CHECK(fclib_write_local_spin(&a, path_of("spin")));
  CHECK(!strcmp(fclib_problem_kind(path_of("spin")), "local_spin"));
  struct fclib_local_spin* back = fclib_read_local_spin(path_of("spin"));
  CHECK(back && back->mu_s[0] == 0.1 && !back->mu_r && back->spacedim == 4 && !back->coupled);

  /* it stops falling; friction slows sliding by mu, the turning by mu_s */
  double r4[] = {1, -0.5, 0, -0.1}, u4[] = {0, 1.5, 0, 0.4};
  struct fclib_solution s = {NULL, u4, r4, NULL};
  CHECK(fclib_validate_local_spin_solution(back, &s));
  CHECK(fclib_merit_local_spin(back, MERIT_2, &s) < 1e-15);
  CHECK(fclib_write_solution(&s, path_of("spin")));
  struct fclib_solve_result result;
  double r[4] = {0}, u[4] = {0};
  struct fclib_solution found = {NULL, u, r, NULL};
  for (int coupled = 0; coupled < 2; coupled++) {
    back->coupled = coupled;
    CHECK(fclib_solve_local_spin(back, "auto", NULL, &found, &result));
    CHECK(fclib_merit_local_spin(back, MERIT_2, &found) < 1e-8);
    CHECK((fabs(r[1] + 0.5) < 1e-6) == !coupled);
  }
  CHECK(!fclib_write_siconos_local_spin(back, path_of("text")));
  SAYS("spin friction");
  a.coupled = 2;
  CHECK(!fclib_validate_local_spin(&a));
  SAYS("/fclib_local_spin/coupled: is 2, but must be 0 or 1");
  fclib_delete_local_spin(back);
  free(back);

  /* with rolling it has six components */
  struct fclib_matrix six = {6, 6, 6, columns, rows, one, -1, NULL};
  double q6[] = {-1, 2, 0, 0.5, 0.5, 0}, mu_r[] = {0.2};
  a.W = &six;
  a.q = q6;
  a.spacedim = 6;
  a.coupled = 0;
  CHECK(!fclib_validate_local_spin(&a));
  SAYS("mu_r");
  a.mu_r = mu_r;
  CHECK(fclib_validate_local_spin(&a));
}

static void solving(void) {
  struct fclib_local a = local();
  struct fclib_global b = global();
  double v_[3], u_[3], r_[3];
  struct fclib_solution s = {v_, u_, r_, NULL};
  struct fclib_solve_result result;
  CHECK(fclib_solver_name(0) && !fclib_solver_name(-1) && !fclib_solver_name(1000));
  CHECK(fclib_solve_local(&a, "nsgs", NULL, &s, &result));
  CHECK(result.status == FCLIB_CONVERGED && result.error <= 1e-8 && result.iterations > 0);
  const char* names[] = {"converged",   "iteration_limit", "time_limit", "diverged", "inaccurate",
                         "interrupted", "stalled",         "infeasible", "invalid"};
  for (int k = 0; k <= FCLIB_INVALID; k++)
    CHECK(!strcmp(fclib_status_name((enum fclib_status)k), names[k]));
  CHECK(!strcmp(fclib_status_name((enum fclib_status)99), "unknown"));
  CHECK(fabs(r_[1] + 0.5) < 1e-8 && fabs(u_[1] - 1.5) < 1e-8);
  CHECK(fclib_solve_global(&b, "nsgs", NULL, &s, NULL));
  CHECK(fabs(v_[1] - 1.5) < 1e-8);

  struct fclib_solve_options options = {1e-12, 50, 5, r, NULL, NULL, NULL};
  CHECK(fclib_solve_local(&a, "nsgs", &options, &s, &result) && result.error <= 1e-12);
  CHECK(!fclib_solve_local(&a, "no such solver", NULL, &s, &result));
  SAYS("nsgs");
  options.options = "no_such_option=1";
  CHECK(!fclib_solve_local(&a, "nsgs", &options, &s, &result));
  SAYS("no_such_option");
  options.options = "nonsense";
  CHECK(!fclib_solve_local(&a, "nsgs", &options, &s, &result));
  options.options = NULL;
  options.tolerance = -1;
  CHECK(!fclib_solve_local(&a, "nsgs", &options, &s, &result));
  options.tolerance = INFINITY;
  CHECK(!fclib_solve_local(&a, "nsgs", &options, &s, &result));
  SAYS("finite");
  CHECK(!fclib_solve_local(&a, NULL, NULL, &s, &result));
  CHECK(!fclib_solve_local(&a, "nsgs", NULL, NULL, &result));
  s.r = NULL;
  CHECK(!fclib_solve_local(&a, "nsgs", NULL, &s, &result));
}

/* two contacts that close a body in from both sides: normal reactions that move nothing prove it */
static void certificates(void) {
  double x[] = {1, -1, 1, -1, -1, 1, -1, 1};
  int rows[] = {0, 2, 1, 3, 0, 2, 1, 3}, columns[] = {0, 0, 1, 1, 2, 2, 3, 3};
  struct fclib_matrix W = {8, 4, 4, columns, rows, x, 8, NULL};
  double mu_[] = {0.5, 0.5}, q[] = {-1, 0, -1, 0};
  struct fclib_local a = {&W, NULL, NULL, mu_, q, NULL, 2, NULL};
  double r_[4], y[2] = {0, 0};
  struct fclib_solution s = {NULL, NULL, r_, NULL};
  struct fclib_solve_options options = {0};
  struct fclib_solve_result result;
  options.certificate_y = y;
  CHECK(fclib_solve_local(&a, "auto", &options, &s, &result));
  CHECK(result.status == FCLIB_INFEASIBLE &&
        !strcmp(fclib_status_name(result.status), "infeasible"));
  CHECK(isinf(result.certificate_bound) && y[0] > 0 && y[0] == y[1]);
  CHECK(isinf(fclib_certificate_local(&a, y, NULL)));
  y[1] *= 2; /* which moves the body */
  CHECK(fclib_certificate_local(&a, y, NULL) == 0 && !*fclib_last_error());
  y[1] = NAN;
  CHECK(isnan(fclib_certificate_local(&a, y, NULL)));
  SAYS("y[1]");
  CHECK(isnan(fclib_certificate_local(&a, NULL, NULL)));
  SAYS("y");
  y[0] = y[1] = 1;
  q[0] = 2; /* the other way round they part */
  CHECK(fclib_certificate_local(&a, y, NULL) == 0);
  CHECK(fclib_solve_local(&a, "auto", &options, &s, &result));
  CHECK(result.status == FCLIB_CONVERGED && result.certificate_bound == 0 && y[0] == 1);
}

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  snprintf(folder, sizeof folder, "%s", argv[1]);
  fclib_set_error_handler(NULL, NULL); /* which is silent */
  version();
  errors();
  handlers();
  modes();
  validation_and_merits();
  rolling();
  spin();
  geometry();
  sequence();
  solving();
  certificates();
  return 0;
}
