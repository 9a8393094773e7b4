/* fclib_plugin.h: solvers of one's own in C or C++, as a shared object that fclib loads.
 *
 *   cc -O2 -shared -fPIC mine.c -o libmine.so
 *   fclib solve problem.hdf5 --solver plugin:./libmine.so
 *
 * The shared object exports one function, fclib_plugin_solve(). It is given the local problem
 * without bilateral constraints, whatever the user's is,
 *
 *   u = W r + q,   K* contains u^,   u^ . r = 0,   r in K,
 *
 * in the conventions of fclib.h, and the starting point in r. It calls stop() in every iteration,
 * and leaves its best iterate in r. It is run and judged like the solvers of fclib: the error is
 * recomputed from r, the limits are kept by stop().
 */
#ifndef FCLIB_PLUGIN_H
#define FCLIB_PLUGIN_H

#ifdef __cplusplus
extern "C" {
#endif

/** What a plugin is given. The arrays are fclib's, and stay as they are during the call. Members
 *  are only ever added at the end; size tells which are there. */
struct fclib_plugin_problem {
  int size;         /**< of this struct, in bytes */
  int spacedim;     /**< components of a contact, d: 2 or 3 */
  int contacts;     /**< nc; m = d nc */
  const int* start; /**< W by rows: the entries of row k are start[k], ..., start[k + 1] - 1 */
  const int* column;
  const double* value;
  const double* q;  /**< (m) [m/s] */
  const double* mu; /**< (nc) [1] */
  double tolerance; /**< on MERIT_2 */
  /** Whether it is time to stop: r is within the tolerance, or a limit is reached. To be called in
   *  every iteration. */
  int (*stop)(void* context, const double* r);
  void* context; /**< for stop() */
};

/** What the shared object exports. r (m) has the starting point, and then the solution. Returns 0,
 *  or another number where it cannot solve such a problem: the call is an error then. */
int fclib_plugin_solve(const struct fclib_plugin_problem* problem, double* r);

#ifdef __cplusplus
}
#endif

#endif /* FCLIB_PLUGIN_H */
