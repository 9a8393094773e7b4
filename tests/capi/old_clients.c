/* What clients of libfclib 3.1 do, and see: what it prints is the same with 3.1 and with ours.
 *
 *   old_clients write FOLDER    writes files as the clients do, reads them again
 *   old_clients read FILE       reads a local problem as Siconos does
 *   old_clients fail FILE       asks for what is not there, and looks at no result
 */
#include <fclib.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char folder[512];

static const char* path_of(const char* name) {
  static char path[1024];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  remove(path);
  return path;
}

static int starts[] = {0, 1, 2, 3}, rows[] = {0, 1, 2}, one_start[] = {0, 1}, one_row[] = {1};
static double one[] = {1, 1, 1}, ones[] = {1}, q[] = {-1, 2, 0}, mu[] = {0.5}, b[] = {0.25};
static double zero[3], u[] = {0, 1.5, 0}, r[] = {1, -0.5, 0}, v[] = {0, 1.5, 0}, l[] = {7};
static struct fclib_matrix identity = {3, 3, 3, starts, rows, one, -1, NULL};
static struct fclib_matrix joint = {1, 3, 1, one_start, one_row, ones, -1, NULL};
static struct fclib_matrix unit = {1, 1, 1, one_start, starts, ones, -1, NULL};

static struct fclib_local local(int joints) {
  struct fclib_local a;
  memset(&a, 0, sizeof a);
  a.W = &identity;
  a.q = q;
  a.mu = mu;
  a.spacedim = 3;
  if (joints) a.V = &joint, a.R = &unit, a.s = b;
  return a;
}

static struct fclib_global global(int joints) {
  struct fclib_global a;
  memset(&a, 0, sizeof a);
  a.M = a.H = &identity;
  a.f = q;
  a.w = zero;
  a.mu = mu;
  a.spacedim = 3;
  if (joints) a.G = &joint, a.b = b;
  return a;
}

/* what the client has given, or the number of doubles that are there to be read */
static void show(const char* name, const double* given, const double* found, int size) {
  double sum = 0;
  printf(" %s", name);
  for (int k = 0; k < size; k++) {
    sum += found[k];
    if (given) printf(" %g", found[k]);
  }
  if (!given) printf(" %s", sum == sum ? "finite" : "nan");
}

static void show_solution(struct fclib_solution* given, struct fclib_solution* found, int n,
                          int p) {
  if (n) show("v", given->v, found->v, n);
  show("u", given->u, found->u, 3);
  show("r", given->r, found->r, 3);
  if (p) show("l", given->l, found->l, p);
  printf("\n");
}

/* every pattern of members that a client leaves out: Siconos' traces set u and r, or u alone */
static void solutions(const char* name, const char* path, int n, int p) {
  for (int left_out = 0; left_out < 16; left_out++) {
    struct fclib_solution s = {v, u, r, l};
    if (left_out & 1) s.v = NULL;
    if (left_out & 2) s.u = NULL;
    if (left_out & 4) s.r = NULL;
    if (left_out & 8) s.l = NULL;
    struct fclib_solution guesses[2] = {{v, u, r, l}, s};
    remove(path);
    struct fclib_local a = local(p);
    struct fclib_global c = global(p);
    printf("%s without %d: %d", name, left_out,
           n ? fclib_write_global(&c, path) : fclib_write_local(&a, path));
    printf(" %d", fclib_write_solution(&s, path));
    printf(" %d", fclib_write_guesses(2, guesses, path));
    struct fclib_solution* found = fclib_read_solution(path);
    show_solution(&s, found, n, p);
    fclib_delete_solutions(found, 1);
    int count;
    found = fclib_read_guesses(path, &count);
    printf("%d", count);
    show_solution(&guesses[0], &found[0], n, p);
    show_solution(&guesses[1], &found[1], n, p);
    fclib_delete_solutions(found, count);
  }
}

/* so-bogus looks at info->title of any problem whose file has a group info */
static void infos(void) {
  char title[] = "a title";
  struct fclib_info none = {NULL, NULL, NULL}, titled = {title, NULL, NULL};
  struct fclib_info* all[] = {NULL, &none, &titled};
  for (int k = 0; k < 3; k++) {
    const char* path = path_of("info");
    struct fclib_local a = local(0);
    a.info = all[k];
    printf("info %d: %d", k, fclib_write_local(&a, path));
    struct fclib_local* found = fclib_read_local(path);
    printf(" %s", found->info ? "a struct" : "NULL");
    if (found->info) {
      printf(" %s %s %s\n", found->info->title ? found->info->title : "-",
             found->info->description ? "+" : "-", found->info->math_info ? "+" : "-");
      printf("number: %d", fclib_create_int_attributes_in_info(path, "number", 3));
    }
    printf("\n");
    fclib_delete_local(found);
    free(found);
  }
}

/* as Siconos' fclib interface tells the storages apart: any other nz is a number of triplets */
static int read_w(const char* path) {
  struct fclib_local* a = fclib_read_local(path);
  if (!a) return 1;
  struct fclib_matrix* W = a->W;
  const int compressed = W->nz == -1 || W->nz == -2, lines = W->nz == -1 ? W->n : W->m;
  printf("%d x %d\n", W->m, W->n);
  for (int line = 0; compressed && line < lines; line++)
    for (int k = W->p[line]; k < W->p[line + 1]; k++)
      printf("%d %d %.17g\n", W->nz == -1 ? W->i[k] : line, W->nz == -1 ? line : W->i[k], W->x[k]);
  for (int k = 0; !compressed && k < W->nz; k++) printf("%d %d %.17g\n", W->i[k], W->p[k], W->x[k]);
  if (!compressed && W->nz < 0) return 2;
  fclib_delete_local(a);
  free(a);
  return 0;
}

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  snprintf(folder, sizeof folder, "%s", argv[2]);
  if (!strcmp(argv[1], "read")) return read_w(argv[2]);
  if (!strcmp(argv[1], "fail")) {
    fclib_read_local(argv[2]);
    return 0;
  }
  infos();
  solutions("local", path_of("local"), 0, 0);
  solutions("global", path_of("global"), 3, 0);
  solutions("mixed local", path_of("mixed_local"), 0, 1);
  solutions("mixed global", path_of("mixed_global"), 3, 1);
  return 0;
}
