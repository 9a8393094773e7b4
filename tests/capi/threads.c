/* Threads, eight at most, that write, read, solve and fail at the same time; ends with 0 where each
 * sees its own files, its own results and its own last error.
 *
 *   threads FOLDER [ROUNDS [ALONE [COUNT]]]
 *
 * ALONE rounds come before, in the main thread: helgrind knows nothing of how C++ guards what is
 * made at its first use, so that all of it is made by then.
 */
#include "checks.h"

#include <pthread.h>
#include <stdatomic.h>

enum { most = 8 };

static atomic_int told; /* how often the handler was called */

/* one contact of a ball on a plane, sliding */
static int columns[] = {0, 1, 2, 3}, rows[] = {0, 1, 2};
static double one[] = {1, 1, 1}, q[] = {-1, 2, 0}, mu[] = {0.5};
static struct fclib_matrix identity = {3, 3, 3, columns, rows, one, -1, NULL};
/* ... by rows, and one that sticks behind it */
static double W[] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1};
static double two_q[] = {-1, 2, 0, -1, 0.2, 0}, two_mu[] = {0.5, 0.5};

static void count_errors(const char* message, void* counter) {
  (void)message;
  atomic_fetch_add((atomic_int*)counter, 1);
}

static void files(struct fclib_local* a, const char* name) {
  double u[] = {0, 1.5, 0}, r[] = {1, -0.5, 0};
  struct fclib_solution s = {NULL, u, r, NULL};
  int number = 0;
  remove(path_of(name));
  CHECK(fclib_write_local(a, path_of(name)));
  CHECK(!fclib_write_local(a, path_of(name))); /* it is there: the handler is called */
  SAYS(name);
  CHECK(fclib_write_solution(&s, path_of(name)) && fclib_write_guesses(1, &s, path_of(name)));
  struct fclib_local* back = fclib_read_local(path_of(name));
  CHECK(back && !*fclib_last_error() && back->q[1] == 2);
  fclib_delete_local(back);
  free(back);
  struct fclib_solution* guesses = fclib_read_guesses(path_of(name), &number);
  CHECK(guesses && number == 1 && guesses->r[1] == -0.5);
  fclib_delete_solutions(guesses, number);
  /* the same file for all */
  back = fclib_read_local(path_of("shared"));
  CHECK(back && back->W->n == 3);
  fclib_delete_local(back);
  free(back);
}

static void solves(struct fclib_local* a, int even) {
  double r[3];
  struct fclib_solution s = {NULL, NULL, r, NULL};
  struct fclib_solve_result result;
  CHECK(fclib_solve_local(a, even ? "nsgs" : "auto", NULL, &s, &result));
  CHECK(result.status == FCLIB_CONVERGED && fabs(r[1] + 0.5) < 1e-8);
  CHECK(fclib_merit_local(a, MERIT_1, &s) < 1e-8);

  struct fclib_global b = global_of(&identity, &identity, q, mu);
  struct fclib_options* options = fclib_options_create();
  CHECK(fclib_options_set_text(options, "solver", even ? "nsn-ac" : "auto"));
  struct fclib_report* report = fclib_solve_global_with(&b, options);
  CHECK(report && !strcmp(fclib_report_text(report, "status"), "converged"));
  fclib_report_delete(report);
  fclib_options_delete(options);
}

static void embedded(struct fclib_workspace* workspace, struct fclib_local* a) {
  double r[3], u[3], both[6];
  enum fclib_status status, each[2];
  const size_t name = 7;
  CHECK(fclib_workspace_solve(workspace, a, &name, 0, r, u, &status, NULL));
  CHECK(status == FCLIB_CONVERGED && fabs(r[1] + 0.5) < 1e-8);
  struct fclib_batch batch = {0};
  batch.size = sizeof batch;
  batch.spacedim = 3;
  batch.count = 2;
  batch.nc_each = 1;
  batch.W = W;
  batch.q = two_q;
  batch.mu = two_mu;
  batch.r = both;
  batch.status = each;
  batch.threads = 2;
  CHECK(fclib_solve_batch(&batch) && each[0] == FCLIB_CONVERGED && each[1] == FCLIB_CONVERGED);
  CHECK(fabs(both[1] + 0.5) < 1e-8 && fabs(both[4] + 0.2) < 1e-8);
}

struct task {
  int number, rounds;
};

static void* work(void* given) {
  const struct task* task = given;
  struct fclib_local a = local_of(&identity, q, mu);
  struct fclib_workspace* workspace = fclib_workspace_new();
  char name[32];
  CHECK(workspace);
  snprintf(name, sizeof name, "thread%d", task->number);
  for (int k = 0; k < task->rounds; k++) {
    files(&a, name);
    solves(&a, k % 2);
    embedded(workspace, &a);
  }
  fclib_workspace_delete(workspace);
  return NULL;
}

int main(int argc, char** argv) {
  if (argc < 2 || argc > 5) return 2;
  snprintf(folder, sizeof folder, "%s", argv[1]);
  const int rounds = argc > 2 ? atoi(argv[2]) : 20;
  const int count = argc > 4 ? atoi(argv[4]) : most;
  if (count > most) return 2;
  struct task alone = {most, argc > 3 ? atoi(argv[3]) : 0};
  fclib_set_error_handler(count_errors, &told);
  struct fclib_local a = local_of(&identity, q, mu);
  remove(path_of("shared"));
  CHECK(fclib_write_local(&a, path_of("shared")));
  work(&alone);
  pthread_t all[most];
  struct task tasks[most];
  for (int k = 0; k < count; k++) {
    tasks[k] = (struct task){k, rounds};
    CHECK(!pthread_create(&all[k], NULL, work, &tasks[k]));
  }
  for (int k = 0; k < count; k++) pthread_join(all[k], NULL);
  CHECK(atomic_load(&told) == count * rounds + alone.rounds);
  return 0;
}
