/* CPU time [s] and memory [bytes] that it takes to save one local problem of W, n x n, by columns.
 *
 *   memory_files WAY N SECONDS FILE
 *
 * WAY: fclib       fclib_write_local, whose driver of HDF5 refers to the arrays
 *      core        HDF5's driver of files in memory, and H5Fget_file_image
 *      core-kept   the same, but the memory of the driver is taken when the file is closed
 * The time is the least of many writes of a new file. The memory is by how much the peak of the
 * process has grown since the problem was there.
 */
#define _DEFAULT_SOURCE
#include <fclib.h>
#include <fcntl.h>
#include <hdf5.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static void require(int fine, const char* what) {
  if (fine) return;
  fprintf(stderr, "%s failed\n", what);
  exit(1);
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* of this program; that of getrusage() is also of the program that started it */
static double peak(void) {
  char line[256];
  double kilobytes = -1;
  FILE* status = fopen("/proc/self/status", "r");
  require(status != NULL, "/proc/self/status");
  while (fgets(line, sizeof line, status)) {
    if (sscanf(line, "VmHWM: %lf", &kilobytes) == 1) break;
  }
  fclose(status);
  require(kilobytes >= 0, "VmHWM");
  return 1024 * kilobytes;
}

/* ---- the problem */

static struct fclib_local made(int n) {
  struct fclib_matrix* W = calloc(1, sizeof *W);
  const size_t entries = (size_t)n * (size_t)n;
  unsigned long long state = 1;
  require(W != NULL, "calloc");
  W->nzmax = n * n;
  W->m = W->n = n;
  W->nz = -1;
  W->p = malloc(((size_t)n + 1) * sizeof *W->p);
  W->i = malloc(entries * sizeof *W->i);
  W->x = malloc(entries * sizeof *W->x);
  struct fclib_local problem = {.spacedim = 3, .W = W};
  problem.q = calloc((size_t)n, sizeof(double));
  problem.mu = calloc((size_t)n / 3, sizeof(double));
  require(W->p && W->i && W->x && problem.q && problem.mu, "malloc");
  for (int k = 0; k <= n; k++) W->p[k] = k * n;
  for (size_t k = 0; k < entries; k++) {
    W->i[k] = (int)(k % (size_t)n);
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    W->x[k] = (double)(state >> 11) * 0x1p-53;
  }
  return problem;
}

/* ---- by HDF5's own driver */

static void put(hid_t group, const char* name, hid_t type, size_t size, const void* data) {
  const hsize_t extent = size;
  const hid_t space = H5Screate_simple(1, &extent, NULL);
  const hid_t set = H5Dcreate2(group, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  require(H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0, name);
  H5Dclose(set);
  H5Sclose(space);
}

static void* taken; /* the memory of the last file that was closed */

static void* take_new(size_t size, H5FD_file_image_op_t why, void* own) {
  (void)why, (void)own;
  return malloc(size);
}
static void* take_copy(void* to, const void* from, size_t size, H5FD_file_image_op_t why,
                       void* own) {
  (void)why, (void)own;
  return memcpy(to, from, size);
}
static void* take_more(void* old, size_t size, H5FD_file_image_op_t why, void* own) {
  (void)why, (void)own;
  return realloc(old, size);
}
static herr_t keep_last(void* memory, H5FD_file_image_op_t why, void* own) {
  (void)own;
  if (why == H5FD_FILE_IMAGE_OP_FILE_CLOSE) {
    taken = memory;
  } else {
    free(memory);
  }
  return 0;
}

static void write_bytes(const char* path, const char* bytes, size_t size) {
  const int file = open(path, O_CREAT | O_EXCL | O_WRONLY, 0666);
  require(file >= 0, path);
  while (size > 0) {
    const ssize_t count = write(file, bytes, size);
    require(count > 0, "write");
    bytes += count;
    size -= (size_t)count;
  }
  require(fsync(file) == 0 && close(file) == 0, "fsync");
}

static void save_by_core(const struct fclib_local* problem, const char* path, int kept) {
  const struct fclib_matrix* W = problem->W;
  const size_t m = (size_t)W->m, entries = m * m;
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  H5Pset_fapl_core(access, (size_t)1 << 16, 0);
  H5FD_file_image_callbacks_t callbacks = {take_new, take_copy, take_more, keep_last,
                                           NULL,     NULL,      NULL};
  if (kept) require(H5Pset_file_image_callbacks(access, &callbacks) >= 0, "callbacks");
  const hid_t file = H5Fcreate("new", H5F_ACC_TRUNC, H5P_DEFAULT, access);
  require(file >= 0, "H5Fcreate");
  put(file, "p", H5T_NATIVE_INT, m + 1, W->p);
  put(file, "i", H5T_NATIVE_INT, entries, W->i);
  put(file, "x", H5T_NATIVE_DOUBLE, entries, W->x);
  put(file, "q", H5T_NATIVE_DOUBLE, m, problem->q);
  put(file, "mu", H5T_NATIVE_DOUBLE, m / 3, problem->mu);
  require(H5Fflush(file, H5F_SCOPE_LOCAL) >= 0, "H5Fflush");
  const ssize_t size = H5Fget_file_image(file, NULL, 0);
  require(size > 0, "H5Fget_file_image");
  char* image = NULL;
  if (!kept) {
    image = malloc((size_t)size);
    require(image && H5Fget_file_image(file, image, (size_t)size) == size, "H5Fget_file_image");
  }
  H5Fclose(file);
  H5Pclose(access);
  write_bytes(path, kept ? taken : image, (size_t)size);
  free(image);
  if (kept) free(taken);
}

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  const char* const path = argv[4];
  struct fclib_local problem = made(atoi(argv[2]));
  const double seconds = atof(argv[3]), before = peak(), start = now();
  double least = 1e300;
  do {
    remove(path);
    const double begin = now();
    if (strcmp(argv[1], "fclib") == 0) {
      require(fclib_write_local(&problem, path), "fclib_write_local");
    } else {
      save_by_core(&problem, path, strcmp(argv[1], "core-kept") == 0);
    }
    const double took = now() - begin;
    if (took < least) least = took;
  } while (now() - start < seconds);
  printf("%.9g %.9g\n", least, peak() - before);
  fclib_delete_local(&problem);
  return 0;
}
