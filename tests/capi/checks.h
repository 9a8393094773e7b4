/* What the longer C tests share: files in a folder, and problems of given data. */
#include <math.h>

#include "check.h"

static char folder[512];

static const char* path_of(const char* name) {
  static _Thread_local char path[1024];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  return path;
}

static double none[6];

static struct fclib_local local_of(struct fclib_matrix* W, double* q, double* mu) {
  struct fclib_local a = {0};
  a.W = W;
  a.q = q;
  a.mu = mu;
  a.spacedim = 3;
  return a;
}
/* M v = H r + f, u = H^T v */
static struct fclib_global global_of(struct fclib_matrix* M, struct fclib_matrix* H, double* f,
                                     double* mu) {
  struct fclib_global a = {0};
  a.M = M;
  a.H = H;
  a.f = f;
  a.w = none;
  a.mu = mu;
  a.spacedim = 3;
  return a;
}
