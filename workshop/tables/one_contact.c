/* CPU time of one call that solves one sliding contact [us], in C: "NAME TOTAL SOLVER" a line, the
 * least of many rounds; SOLVER is -1 where the call does not tell it.
 *
 *   one_contact ROUNDS CALLS W11 W21 ... W33 q1 q2 q3 mu
 */
#include <fclib.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

static int starts[] = {0, 3, 6, 9}, rows[] = {0, 1, 2, 0, 1, 2, 0, 1, 2};
static double data[13], *const x = data, *const q = data + 9, *const mu = data + 12;
static double r[3], u[3], own;
static struct fclib_matrix W = {9, 3, 3, starts, rows, data, -1, NULL};
static struct fclib_local problem;
static struct fclib_workspace* workspace;

static int solve(void) {
  struct fclib_solution solution = {NULL, u, r, NULL};
  struct fclib_solve_result result;
  if (!fclib_solve_local(&problem, "auto", NULL, &solution, &result)) return 0;
  own += 1e6 * result.cpu_s;
  return result.status == FCLIB_CONVERGED;
}

static int step(void) {
  enum fclib_status status;
  fclib_workspace_forget(workspace); /* no call starts from the solution */
  return fclib_workspace_solve(workspace, &problem, NULL, 0, r, u, &status, NULL) &&
         status == FCLIB_CONVERGED;
}

static int batch_of_one(void) {
  struct fclib_batch batch = {0};
  enum fclib_status status;
  batch.size = sizeof batch;
  batch.spacedim = 3;
  batch.count = batch.nc_each = 1;
  batch.W = x;
  batch.q = q;
  batch.mu = mu;
  batch.r = r;
  batch.u = u;
  batch.status = &status;
  return fclib_solve_batch(&batch) && status == FCLIB_CONVERGED;
}

static void measure(const char* name, int (*call)(void), int rounds, int calls) {
  double least = 1e300, solver = -1;
  for (int round = 0; round < rounds; round++) {
    own = 0;
    const double start = now();
    for (int k = 0; k < calls; k++) {
      if (call()) continue;
      fprintf(stderr, "%s: %s\n", name, fclib_last_error());
      exit(1);
    }
    const double spent = (now() - start) / calls;
    if (spent >= least) continue;
    least = spent;
    solver = own > 0 ? own / calls : -1;
  }
  printf("%s %.4f %.4f\n", name, least, solver);
}

int main(int argc, char** argv) {
  if (argc != 16) return 2;
  const int rounds = atoi(argv[1]), calls = atoi(argv[2]);
  for (int k = 0; k < 13; k++) data[k] = atof(argv[k + 3]);
  problem.W = &W;
  problem.q = q;
  problem.mu = mu;
  problem.spacedim = 3;
  workspace = fclib_workspace_new();
  measure("fclib_solve_local", solve, rounds, calls);
  measure("fclib_workspace_solve", step, rounds, calls);
  measure("fclib_solve_batch", batch_of_one, rounds, calls);
  fclib_workspace_delete(workspace);
  return 0;
}
