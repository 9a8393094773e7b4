/* Two libraries with the interface of libfclib 3.1 in one process, over the same HDF5.
 *
 *   copy THEIRS OURS FILE OUT_THEIRS OUT_OURS    both write what ours reads from FILE
 *   time THEIRS OURS FILE_THEIRS FILE_OURS LIMIT least CPU times of a read [s], taken by turns
 *                                                for LIMIT seconds: 3.1 its own file, ours its
 *                                                own, ours that of 3.1, 3.1 ours
 *   write THEIRS OURS FILE OUT LIMIT             least CPU times of a write [s] of what ours reads
 *                                                from FILE, taken by turns: 3.1, ours plain, ours
 *                                                as it is by default
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fclib.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

struct library {
  struct fclib_local* (*read_local)(const char*);
  struct fclib_global* (*read_global)(const char*);
  struct fclib_solution* (*read_solution)(const char*);
  struct fclib_solution* (*read_guesses)(const char*, int*);
  int (*write_local)(struct fclib_local*, const char*);
  int (*write_global)(struct fclib_global*, const char*);
  int (*write_solution)(struct fclib_solution*, const char*);
  int (*write_guesses)(int, struct fclib_solution*, const char*);
  void (*delete_local)(struct fclib_local*);
  void (*delete_global)(struct fclib_global*);
  void (*delete_solutions)(struct fclib_solution*, int);
  int (*set_compression)(int); /* NULL in 3.1 */
};

static void* symbol(void* handle, const char* name) {
  void* found = dlsym(handle, name);
  if (!found) {
    fprintf(stderr, "%s\n", dlerror());
    exit(1);
  }
  return found;
}

static struct library load(const char* path) {
  void* handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  if (!handle) {
    fprintf(stderr, "%s\n", dlerror());
    exit(1);
  }
  struct library lib;
  *(void**)&lib.read_local = symbol(handle, "fclib_read_local");
  *(void**)&lib.read_global = symbol(handle, "fclib_read_global");
  *(void**)&lib.read_solution = symbol(handle, "fclib_read_solution");
  *(void**)&lib.read_guesses = symbol(handle, "fclib_read_guesses");
  *(void**)&lib.write_local = symbol(handle, "fclib_write_local");
  *(void**)&lib.write_global = symbol(handle, "fclib_write_global");
  *(void**)&lib.write_solution = symbol(handle, "fclib_write_solution");
  *(void**)&lib.write_guesses = symbol(handle, "fclib_write_guesses");
  *(void**)&lib.delete_local = symbol(handle, "fclib_delete_local");
  *(void**)&lib.delete_global = symbol(handle, "fclib_delete_global");
  *(void**)&lib.delete_solutions = symbol(handle, "fclib_delete_solutions");
  *(void**)&lib.set_compression = dlsym(handle, "fclib_set_compression");
  return lib;
}

struct problem {
  struct fclib_local* local;
  struct fclib_global* global;
};

static struct problem read_problem(const struct library* lib, const char* path, int local) {
  struct problem p = {NULL, NULL};
  if (local) {
    p.local = lib->read_local(path);
  } else {
    p.global = lib->read_global(path);
  }
  return p;
}

static void free_problem(const struct library* lib, struct problem p) {
  if (p.local) lib->delete_local(p.local);
  if (p.global) lib->delete_global(p.global);
  free(p.local);
  free(p.global);
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* ---- equality, bit by bit ---- */

static int same(const void* a, const void* b, size_t bytes) {
  if (bytes == 0) return 1;
  return a && b ? !memcmp(a, b, bytes) : a == b;
}

static int same_matrix(const struct fclib_matrix* a, const struct fclib_matrix* b) {
  if (!a || !b) return a == b;
  if (a->m != b->m || a->n != b->n || a->nz != b->nz) return 0;
  size_t pointers = (size_t)(a->nz >= 0 ? a->nz : (a->nz == -1 ? a->n : a->m) + 1);
  size_t entries = (size_t)(a->nz >= 0 ? a->nz : a->nzmax);
  return (a->nz >= 0 || a->nzmax == b->nzmax) && same(a->p, b->p, pointers * sizeof(int)) &&
         same(a->i, b->i, entries * sizeof(int)) && same(a->x, b->x, entries * sizeof(double));
}

static int same_problem(struct problem a, struct problem b) {
  const size_t size = sizeof(double);
  if (a.local && b.local) {
    const struct fclib_local *x = a.local, *y = b.local;
    size_t m = (size_t)x->W->m, p = x->R ? (size_t)x->R->m : 0;
    return x->spacedim == y->spacedim && same_matrix(x->W, y->W) && same_matrix(x->V, y->V) &&
           same_matrix(x->R, y->R) && same(x->q, y->q, m * size) && same(x->s, y->s, p * size) &&
           same(x->mu, y->mu, m / (size_t)x->spacedim * size);
  }
  if (a.global && b.global) {
    const struct fclib_global *x = a.global, *y = b.global;
    size_t n = (size_t)x->M->m, m = (size_t)x->H->n, p = x->G ? (size_t)x->G->n : 0;
    return x->spacedim == y->spacedim && same_matrix(x->M, y->M) && same_matrix(x->H, y->H) &&
           same_matrix(x->G, y->G) && same(x->f, y->f, n * size) && same(x->w, y->w, m * size) &&
           same(x->b, y->b, p * size) && same(x->mu, y->mu, m / (size_t)x->spacedim * size);
  }
  return 0;
}

/* ---- the two jobs ---- */

static int copy(const struct library* theirs, const struct library* ours, const char* from,
                const char* to_theirs, const char* to_ours) {
  struct problem p = read_problem(ours, from, 1);
  if (!p.local) p = read_problem(ours, from, 0);
  if (!p.local && !p.global) return 3; /* of a kind that 3.1 does not know */
  struct fclib_solution* solution = ours->read_solution(from);
  int count = 0;
  struct fclib_solution* guesses = ours->read_guesses(from, &count);
  /* 3.1 takes no solution without contacts */
  if (p.local ? !p.local->W->m : !p.global->H->n) solution = guesses = NULL;
  const struct library* library[2] = {theirs, ours};
  const char* path[2] = {to_theirs, to_ours};
  for (int k = 0; k < 2; k++) {
    const struct library* lib = library[k];
    remove(path[k]);
    if (p.local ? !lib->write_local(p.local, path[k]) : !lib->write_global(p.global, path[k]))
      return 1;
    if (solution && !lib->write_solution(solution, path[k])) return 1;
    if (guesses && !lib->write_guesses(count, guesses, path[k])) return 1;
  }
  printf("%s %d %d\n", p.local ? "local" : "global", solution != NULL, guesses ? count : 0);
  return 0;
}

static int take_times(const struct library* theirs, const struct library* ours,
                      const char* file_theirs, const char* file_ours, double limit) {
  const struct library* library[4] = {theirs, ours, ours, theirs};
  const char* file[4] = {file_theirs, file_ours, file_theirs, file_ours};
  struct problem first[4];
  struct problem probe = read_problem(ours, file_ours, 1);
  const int local = probe.local != NULL;
  free_problem(ours, probe);
  double least[4];
  const double begun = now();
  for (int k = 0; k < 4; k++) {
    first[k] = read_problem(library[k], file[k], local);
    least[k] = 1e9;
    if (!same_problem(first[0], first[k])) {
      fprintf(stderr, "what is read differs\n");
      return 1;
    }
  }
  for (int turn = 0; turn < 9 || (now() - begun < limit && turn < 1000); turn++) {
    for (int k = 0; k < 4; k++) {
      const double start = now();
      struct problem p = read_problem(library[k], file[k], local);
      free_problem(library[k], p);
      const double taken = now() - start;
      if (taken < least[k]) least[k] = taken;
    }
  }
  for (int k = 0; k < 4; k++) {
    printf("%.9f ", least[k]);
    free_problem(library[k], first[k]);
  }
  printf("\n");
  return 0;
}

static int take_times_of_writes(const struct library* theirs, const struct library* ours,
                                const char* from, const char* to, double limit) {
  struct problem p = read_problem(ours, from, 1);
  if (!p.local) p = read_problem(ours, from, 0);
  if (!p.local && !p.global) return 3;
  const struct library* library[3] = {theirs, ours, ours};
  const int level[3] = {0, 0, 6};
  double least[3] = {1e9, 1e9, 1e9};
  const double begun = now();
  for (int turn = 0; turn < 5 || (now() - begun < limit && turn < 1000); turn++) {
    for (int k = 0; k < 3; k++) {
      const struct library* lib = library[k];
      if (lib->set_compression) lib->set_compression(level[k]);
      remove(to);
      const double start = now();
      if (p.local ? !lib->write_local(p.local, to) : !lib->write_global(p.global, to)) return 1;
      const double taken = now() - start;
      if (taken < least[k]) least[k] = taken;
    }
  }
  for (int k = 0; k < 3; k++) printf("%.9f ", least[k]);
  printf("\n");
  free_problem(ours, p);
  return 0;
}

int main(int argc, char** argv) {
  if (argc < 6) return 2;
  const struct library theirs = load(argv[2]), ours = load(argv[3]);
  if (!strcmp(argv[1], "copy") && argc == 7) return copy(&theirs, &ours, argv[4], argv[5], argv[6]);
  if (!strcmp(argv[1], "time") && argc == 7)
    return take_times(&theirs, &ours, argv[4], argv[5], atof(argv[6]));
  if (!strcmp(argv[1], "write") && argc == 7)
    return take_times_of_writes(&theirs, &ours, argv[4], argv[5], atof(argv[6]));
  return 2;
}
