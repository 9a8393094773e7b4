/* Records steps of 17 contacts between two bodies from C: "WAY CPU_SECONDS_A_STEP BYTES_A_STEP" a
 * line.
 *
 *   sequence_file FOLDER STEPS PLAIN
 *
 * The steps go into a sequence, without and with a flush after each, and PLAIN of them into files
 * of their own. In each step all of H, f and w is new; the pattern of H, M and mu stay.
 */
#include <fclib.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <time.h>

enum { nc = 17, m = 3 * nc, n = 12, entries = 6 * m };

static int starts_M[n + 1], rows_M[n], starts_H[m + 1], rows_H[entries];
static double mass[n], H[entries], f[n], w[m], mu[nc];

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void next_step(unsigned long* state) {
  for (int k = 0; k < entries + n + m; k++) {
    *state = *state * 6364136223846793005UL + 1442695040888963407UL;
    const double number = (double)(*state >> 11) / 9007199254740992.0 - 0.5;
    if (k < entries)
      H[k] = number;
    else if (k < entries + n)
      f[k - entries] = number;
    else
      w[k - entries - n] = number < 0 ? -number : number; /* so there is a solution */
  }
}

static double bytes_of(const char* path) {
  struct stat status;
  return stat(path, &status) ? 0 : (double)status.st_size;
}

int main(int argc, char** argv) {
  if (argc < 4) return 2;
  const int steps = atoi(argv[2]), plain = atoi(argv[3]);
  for (int k = 0; k <= n; k++) starts_M[k] = k;
  for (int k = 0; k < n; k++) rows_M[k] = k, mass[k] = 1 + k;
  for (int k = 0; k <= m; k++) starts_H[k] = 6 * k;
  for (int k = 0; k < entries; k++) rows_H[k] = k / 18 % 2 * 6 + k % 6;
  for (int k = 0; k < nc; k++) mu[k] = 0.5;
  struct fclib_matrix M_of = {n, n, n, starts_M, rows_M, mass, -1, NULL};
  struct fclib_matrix H_of = {entries, n, m, starts_H, rows_H, H, -1, NULL};
  struct fclib_global problem = {&M_of, &H_of, NULL, mu, f, NULL, w, 3, NULL};
  unsigned long state = 1;
  char path[4096];

  for (int flushed = 0; flushed < 2; flushed++) {
    snprintf(path, sizeof path, "%s/c-%d.h5", argv[1], flushed);
    const double start = now();
    struct fclib_sequence* sequence = fclib_sequence_create(path, NULL);
    if (!sequence) return 1;
    for (int k = 0; k < steps; k++) {
      next_step(&state);
      if (!fclib_sequence_add_global(sequence, &problem, 0)) return 1;
      if (flushed && !fclib_sequence_flush(sequence)) return 1;
    }
    if (!fclib_sequence_close(sequence)) return 1;
    const double seconds = (now() - start) / steps;
    printf("%s %g %g\n", flushed ? "flushed" : "sequence", seconds, bytes_of(path) / steps);
  }
  double bytes = 0;
  const double start = now();
  for (int k = 0; k < plain; k++) {
    snprintf(path, sizeof path, "%s/c-%d.hdf5", argv[1], k);
    next_step(&state);
    if (!fclib_write_global(&problem, path)) return 1;
    bytes += bytes_of(path);
  }
  if (plain) printf("plain %g %g\n", (now() - start) / plain, bytes / plain);
  return 0;
}
