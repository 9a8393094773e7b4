/* Writes and prints problems as words, by the functions of libfclib 3.1, for any kind and storage.
 *
 *   exchange write < words    problems, each preceded by the path it goes to
 *   exchange show < words     the same words of the files that lines "kind what path" name; "s" and
 *                             "g" in what say that there are a solution and guesses
 *   exchange merit < words    MERIT_1 of each problem and its solution; the path is not used
 *
 * problem   path kind spacedim matrix matrix matrix vector vector vector vector info solution
 *           guesses, members in the order of the struct, kinds local, global, and unless ONLY_3_1
 * is defined local_rolling and global_rolling (one vector more), local_spin and global_spin matrix
 * "-" or nzmax m n nz p... i... x... info vector    "-" or its numbers, whose count the matrices
 * give info      "-" or texts; for a matrix one text and conditioning, determinant, rank text "-"
 * or "=" and its bytes in hexadecimal solution  "-" or vectors v u r l;  guesses: their number, and
 * solutions
 */
#include <fclib.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char word[1 << 16];

static int next(void) { return scanf("%65535s", word) == 1; }

static void need(int ok, const char* what) {
  if (ok) return;
  fprintf(stderr, "exchange: %s\n", what);
  exit(2);
}

/* ---- words to structs */

static int read_int(void) {
  need(next(), "a number is missing");
  return atoi(word);
}

static double* read_vector(int size) {
  need(next(), "a vector is missing");
  if (!strcmp(word, "-") && size > 0) return NULL;
  double* x = malloc(sizeof *x * (size_t)(size + 1));
  for (int k = 0; k < size; k++) {
    if (k) need(next(), "an entry is missing");
    x[k] = strtod(word, NULL);
  }
  return x;
}

static int* read_ints(int size) {
  int* x = malloc(sizeof *x * (size_t)(size + 1));
  for (int k = 0; k < size; k++) x[k] = read_int();
  return x;
}

static char* read_text(void) {
  need(next(), "a text is missing");
  if (!strcmp(word, "-")) return NULL;
  size_t size = strlen(word + 1) / 2;
  char* text = malloc(size + 1);
  for (size_t k = 0; k < size; k++) {
    unsigned byte;
    sscanf(word + 1 + 2 * k, "%2x", &byte);
    text[k] = (char)byte;
  }
  text[size] = 0;
  return text;
}

static struct fclib_matrix* read_matrix(void) {
  need(next(), "a matrix is missing");
  if (!strcmp(word, "-")) return NULL;
  struct fclib_matrix* a = calloc(1, sizeof *a);
  a->nzmax = atoi(word);
  a->m = read_int();
  a->n = read_int();
  a->nz = read_int();
  if (a->nz > -3) {
    a->p = read_ints(a->nz >= 0 ? a->nz : a->nz == -1 ? a->n + 1 : a->m + 1);
    a->i = read_ints(a->nz >= 0 ? a->nz : a->nzmax);
  }
  int entries = a->nz >= 0 ? a->nz : a->nzmax;
  a->x = malloc(sizeof *a->x * (size_t)(entries + 1));
  for (int k = 0; k < entries; k++) {
    need(next(), "an entry is missing");
    a->x[k] = strtod(word, NULL);
  }
  need(next(), "an info is missing");
  if (!strcmp(word, "+")) {
    a->info = calloc(1, sizeof *a->info);
    a->info->comment = read_text();
    need(next(), "an info is missing");
    a->info->conditioning = strtod(word, NULL);
    need(next(), "an info is missing");
    a->info->determinant = strtod(word, NULL);
    a->info->rank = read_int();
  }
  return a;
}

static struct fclib_info* read_info(void) {
  need(next(), "an info is missing");
  if (!strcmp(word, "-")) return NULL;
  struct fclib_info* info = calloc(1, sizeof *info);
  info->title = read_text();
  info->description = read_text();
  info->math_info = read_text();
  return info;
}

static struct fclib_solution read_members(int n, int m, int p) {
  struct fclib_solution s;
  s.v = read_vector(n);
  s.u = read_vector(m);
  s.r = read_vector(m);
  s.l = read_vector(p);
  return s;
}

static void free_members(struct fclib_solution* s) {
  free(s->v);
  free(s->u);
  free(s->r);
  free(s->l);
}

/* ---- structs to words */

static void show_vector(const double* x, int size) {
  if (!x || !size) printf(" -");
  for (int k = 0; x && k < size; k++) printf(" %a", x[k]);
}

static void show_text(const char* text) {
  printf(text ? " =" : " -");
  for (; text && *text; text++) printf("%02x", (unsigned char)*text);
}

static void show_matrix(const struct fclib_matrix* a) {
  if (!a) {
    printf(" -");
    return;
  }
  printf(" %d %d %d %d", a->nzmax, a->m, a->n, a->nz);
  int entries = a->nz >= 0 ? a->nz : a->nzmax;
  if (a->nz > -3) {
    int pointers = a->nz >= 0 ? a->nz : a->nz == -1 ? a->n + 1 : a->m + 1;
    for (int k = 0; k < pointers; k++) printf(" %d", a->p[k]);
    for (int k = 0; k < entries; k++) printf(" %d", a->i[k]);
  }
  for (int k = 0; k < entries; k++) printf(" %a", a->x[k]);
  printf(a->info ? " +" : " -");
  if (a->info) {
    show_text(a->info->comment);
    printf(" %a %a %d", a->info->conditioning, a->info->determinant, a->info->rank);
  }
}

static void show_info(const struct fclib_info* info) {
  printf(info ? " +" : " -");
  if (!info) return;
  show_text(info->title);
  show_text(info->description);
  show_text(info->math_info);
}

static void show_solution(const struct fclib_solution* s, int n, int m, int p) {
  show_vector(s->v, n);
  show_vector(s->u, m);
  show_vector(s->r, m);
  show_vector(s->l, p);
}

/* 3.1 ends the process where it is asked for what is not there, so the caller says what is */
static void show_rest(const char* path, const char* what, int n, int m, int p) {
  struct fclib_solution* s = strchr(what, 's') ? fclib_read_solution(path) : NULL;
  printf(s ? " +" : " -");
  if (s) show_solution(s, n, m, p);
  fclib_delete_solutions(s, s ? 1 : 0);
  int count = 0;
  s = strchr(what, 'g') ? fclib_read_guesses(path, &count) : NULL;
  printf(" %d", count);
  for (int k = 0; k < count; k++) show_solution(s + k, n, m, p);
  fclib_delete_solutions(s, count);
  printf("\n");
}

/* ---- one kind of problem: its matrices A, B, C, its vectors, and what gives the sizes */

#define LOCAL(name, vectors, rolling)                           \
  static void write_##name(const char* path, int merit) {       \
    struct fclib_##name a;                                      \
    a.spacedim = read_int();                                    \
    a.W = read_matrix();                                        \
    a.V = read_matrix();                                        \
    a.R = read_matrix();                                        \
    int m = a.W->n, p = a.R ? a.R->n : 0;                       \
    a.mu = read_vector(m / a.spacedim);                         \
    rolling a.q = read_vector(m);                               \
    a.s = read_vector(p);                                       \
    a.info = read_info();                                       \
    finish(name, 0, m, p)                                       \
  }                                                             \
  static void show_##name(const char* path, const char* what) { \
    struct fclib_##name* a = fclib_read_##name(path);           \
    need(a != NULL, path);                                      \
    int m = a->W->n, p = a->R ? a->R->n : 0;                    \
    printf("%s " #name " %d", path, a->spacedim);               \
    show_matrix(a->W);                                          \
    show_matrix(a->V);                                          \
    show_matrix(a->R);                                          \
    show_vector(a->mu, m / a->spacedim);                        \
    vectors show_vector(a->q, m);                               \
    show_vector(a->s, p);                                       \
    show_info(a->info);                                         \
    fclib_delete_##name(a);                                     \
    free(a);                                                    \
    show_rest(path, what, 0, m, p);                             \
  }

#define GLOBAL(name, vectors, rolling)                          \
  static void write_##name(const char* path, int merit) {       \
    struct fclib_##name a;                                      \
    a.spacedim = read_int();                                    \
    a.M = read_matrix();                                        \
    a.H = read_matrix();                                        \
    a.G = read_matrix();                                        \
    int n = a.M->n, m = a.H->n, p = a.G ? a.G->n : 0;           \
    a.mu = read_vector(m / a.spacedim);                         \
    rolling a.f = read_vector(n);                               \
    a.b = read_vector(p);                                       \
    a.w = read_vector(m);                                       \
    a.info = read_info();                                       \
    finish(name, n, m, p)                                       \
  }                                                             \
  static void show_##name(const char* path, const char* what) { \
    struct fclib_##name* a = fclib_read_##name(path);           \
    need(a != NULL, path);                                      \
    int n = a->M->n, m = a->H->n, p = a->G ? a->G->n : 0;       \
    printf("%s " #name " %d", path, a->spacedim);               \
    show_matrix(a->M);                                          \
    show_matrix(a->H);                                          \
    show_matrix(a->G);                                          \
    show_vector(a->mu, m / a->spacedim);                        \
    vectors show_vector(a->f, n);                               \
    show_vector(a->b, p);                                       \
    show_vector(a->w, m);                                       \
    show_info(a->info);                                         \
    fclib_delete_##name(a);                                     \
    free(a);                                                    \
    show_rest(path, what, n, m, p);                             \
  }

/* the solution and the guesses; then either all goes to the file, or is judged */
#define finish(name, n, m, p)                                         \
  struct fclib_solution s, *guesses;                                  \
  need(next(), "a solution is missing");                              \
  int solved = !strcmp(word, "+");                                    \
  if (solved) s = read_members(n, m, p);                              \
  int count = read_int();                                             \
  guesses = malloc(sizeof *guesses * (size_t)(count + 1));            \
  for (int k = 0; k < count; k++) guesses[k] = read_members(n, m, p); \
  if (merit) {                                                        \
    printf("%a\n", fclib_merit_##name(&a, MERIT_1, &s));              \
  } else {                                                            \
    need(fclib_write_##name(&a, path), path);                         \
    if (solved) need(fclib_write_solution(&s, path), path);           \
    if (count) need(fclib_write_guesses(count, guesses, path), path); \
  }                                                                   \
  fclib_delete_##name(&a);                                            \
  if (solved) free_members(&s);                                       \
  for (int k = 0; k < count; k++) free_members(&guesses[k]);          \
  free(guesses);

LOCAL(local, , )
GLOBAL(global, , )
#ifndef ONLY_3_1
#define READ_ROLLING a.mu_r = read_vector(m / a.spacedim);
#define SHOW_ROLLING show_vector(a->mu_r, m / a->spacedim);
LOCAL(local_rolling, SHOW_ROLLING, READ_ROLLING)
GLOBAL(global_rolling, SHOW_ROLLING, READ_ROLLING)
#define READ_SPIN                                                \
  a.mu_s = read_vector(m / a.spacedim);                          \
  a.mu_r = a.spacedim == 6 ? read_vector(m / a.spacedim) : NULL; \
  a.coupled = read_int();
#define SHOW_SPIN                                              \
  show_vector(a->mu_s, m / a->spacedim);                       \
  if (a->spacedim == 6) show_vector(a->mu_r, m / a->spacedim); \
  printf(" %d", a->coupled);
LOCAL(local_spin, SHOW_SPIN, READ_SPIN)
GLOBAL(global_spin, SHOW_SPIN, READ_SPIN)
#endif

int main(int argc, char** argv) {
  static char path[4096], kind[32];
  need(argc >= 2, "write, show or merit?");
  if (!strcmp(argv[1], "show")) {
    /* lines of kind, what else there is, path */
    static char what[8];
    while (scanf("%31s %7s %4095s", kind, what, path) == 3) {
      if (!strcmp(kind, "local")) show_local(path, what);
      if (!strcmp(kind, "global")) show_global(path, what);
#ifndef ONLY_3_1
      if (!strcmp(kind, "local_rolling")) show_local_rolling(path, what);
      if (!strcmp(kind, "global_rolling")) show_global_rolling(path, what);
      if (!strcmp(kind, "local_spin")) show_local_spin(path, what);
      if (!strcmp(kind, "global_spin")) show_global_spin(path, what);
#endif
    }
    return 0;
  }
  int merit = !strcmp(argv[1], "merit");
  while (scanf("%4095s %31s", path, kind) == 2) {
    if (!strcmp(kind, "local")) write_local(path, merit);
    if (!strcmp(kind, "global")) write_global(path, merit);
#ifndef ONLY_3_1
    if (!strcmp(kind, "local_rolling")) write_local_rolling(path, merit);
    if (!strcmp(kind, "global_rolling")) write_global_rolling(path, merit);
    if (!strcmp(kind, "local_spin")) write_local_spin(path, merit);
    if (!strcmp(kind, "global_spin")) write_global_spin(path, merit);
#endif
  }
  return 0;
}
