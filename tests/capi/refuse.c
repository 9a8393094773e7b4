/* What the library says of files that are wrong. For each line "KIND PATH" of the standard input
 * one line "STEP<tab>MESSAGE": the first step that refuses the file, or "accepted".
 *
 * The steps are read, validate, then with a solution read-solution and validate-solution. What must
 * follow from a refusal is checked here: merits and solves refuse alike, the handler hears of each
 * failure once, and whatever else is asked of the file ends.
 */
#include <fclib.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(condition)                                                              \
  do {                                                                                \
    if (!(condition)) {                                                               \
      fprintf(stderr, "%s, line %d: %s (%s)\n", path, __LINE__, #condition, message); \
      exit(1);                                                                        \
    }                                                                                 \
  } while (0)

enum { ROOM = 4096, SIZE = 1 << 16 };

static char path[ROOM], kind[32], message[ROOM];
static int failures;
static double zeros[SIZE], u[SIZE], r[SIZE], v[SIZE], l[SIZE];

static void count(const char* text, void* context) {
  (void)context;
  failures++;
  snprintf(message, sizeof message, "%s", text);
}

/* whether what was just called failed, and said so once */
static int failed(int result) {
  const int told = failures;
  failures = 0;
  CHECK(told == !result);
  CHECK(result ? !*fclib_last_error() : !strcmp(message, fclib_last_error()));
  return !result;
}

static void say(const char* step) { printf("%s\t%s\n", step, message); }

/* a solution that a problem of any size may be asked about */
static struct fclib_solution zero(void) {
  struct fclib_solution s = {zeros, zeros, zeros, zeros};
  return s;
}

#define REFUSAL_OF(name)                                                       \
  static int refused_##name(void) {                                            \
    struct fclib_##name* problem = fclib_read_##name(path);                    \
    if (failed(!!problem)) return say("read"), 1;                              \
    const int valid = !failed(fclib_validate_##name(problem));                 \
    if (!valid) {                                                              \
      char first[ROOM];                                                        \
      struct fclib_solution s = zero(), out = {v, u, r, l};                    \
      memcpy(first, message, ROOM);                                            \
      for (int merit = MERIT_1; merit <= MERIT_2; merit++) {                   \
        CHECK(failed(!isnan(fclib_merit_##name(problem, merit, &s))));         \
        CHECK(!strcmp(first, message));                                        \
      }                                                                        \
      const char* solver = fclib_solver_name(0);                               \
      CHECK(failed(fclib_solve_##name(problem, solver, NULL, &out, NULL)));    \
      CHECK(!strcmp(first, message));                                          \
      say("validate");                                                         \
    }                                                                          \
    struct fclib_solution* s = valid ? fclib_read_solution(path) : NULL;       \
    int wrong = !valid;                                                        \
    if (valid && (wrong = failed(!!s))) say("read-solution");                  \
    if (s && (wrong = failed(fclib_validate_##name##_solution(problem, s)))) { \
      CHECK(failed(!isnan(fclib_merit_##name(problem, MERIT_2, s))));          \
      say("validate-solution");                                                \
    }                                                                          \
    fclib_delete_solutions(s, 1);                                              \
    fclib_delete_##name(problem);                                              \
    free(problem);                                                             \
    return wrong;                                                              \
  }
REFUSAL_OF(global)
REFUSAL_OF(local)

/* whatever comes of these, they end, and say so where they fail */
static void ask_everything(void) {
  int number;
  struct fclib_solution s = zero();
  struct fclib_solution* solution = fclib_read_solution(path);
  failed(!!solution);
  fclib_delete_solutions(solution, 1);
  struct fclib_solution* guesses = fclib_read_guesses(path, &number);
  /* a file without guesses is no error */
  if (failures || guesses) failed(!!guesses);
  fclib_delete_solutions(guesses, number);
  struct fclib_local_rolling* local = fclib_read_local_rolling(path);
  struct fclib_global_rolling* global = fclib_read_global_rolling(path);
  failures = 0;
  fclib_delete_local_rolling(local);
  fclib_delete_global_rolling(global);
  free(local);
  free(global);
  if (failed(!!fclib_problem_kind(path))) {
    /* what has no problem takes no solution */
    CHECK(failed(fclib_write_solution(&s, path)));
    CHECK(failed(fclib_write_guesses(1, &s, path)));
  }
  failed(fclib_create_int_attributes_in_info(path, "number", 1));
}

int main(void) {
  char line[ROOM];
  fclib_set_error_handler(count, NULL);
  while (fgets(line, sizeof line, stdin)) {
    if (sscanf(line, "%31s %4095[^\n]", kind, path) != 2) return 2;
    strcpy(message, "");
    const int local = !strcmp(kind, "local");
    if (!(local ? refused_local() : refused_global())) say("accepted");
    fflush(stdout);
    ask_everything();
  }
  return 0;
}
