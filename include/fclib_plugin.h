/* fclib_plugin.h: solvers of one's own in C or C++, as a shared object that fclib loads.
 *
 *   cc -O2 -shared -fPIC mine.c -o libmine.so
 *   fclib solve problem.hdf5 --solver plugin:./libmine.so
 *
 * The shared object exports the function fclib_plugin_solve(), and may export
 * fclib_plugin_describe(), which tells of its options. The library loads it where a solver is named
 * "plugin:PATH": in C, C++, Python and on the command line. It is given the local problem without
 * bilateral constraints, whatever the user's is,
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
  int spacedim;     /**< components of a contact, d: 2 or 3, with rolling friction 3 or 5 */
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
  void* context;      /**< for stop(), number() and text() */
  const double* mu_r; /**< (nc) [m], of rolling friction; NULL where there is none */
  /** The value of an option: of a bool 0 or 1, of a choice its place. NaN where it has none. */
  double (*number)(void* context, const char* name);
  /** That of a choice or a text, until the call ends. NULL where it has none. */
  const char* (*text)(void* context, const char* name);
};

/** An option of a plugin, which users give by its name. What it does not need may be 0 or NULL. */
struct fclib_plugin_option {
  const char* name;  /**< NULL ends the list */
  const char* type;  /**< "bool", "int", "float", "choice" or "text" */
  const char* value; /**< the default, in words: "true", "20", "1.5" */
  const char* unit;
  const char* doc;            /**< what it means, in a line */
  const char* const* choices; /**< of a choice: its values, and NULL */
  double lowest;              /**< of a number; no bounds where both are 0 */
  double highest;
};

/** What a plugin is. */
struct fclib_plugin_about {
  int size;                                  /**< of this struct, in bytes */
  int rolling;                               /**< 1: it takes problems of rolling friction too */
  const char* title;                         /**< a line, or NULL */
  const char* citation;                      /**< or NULL */
  const struct fclib_plugin_option* options; /**< or NULL */
};

/** What the shared object exports. r (m) has the starting point, and then the solution. Returns 0,
 *  or another number where it cannot solve such a problem: the call is an error then. */
int fclib_plugin_solve(const struct fclib_plugin_problem* problem, double* r);

/** What the shared object may export: what it is, for as long as it is loaded. */
const struct fclib_plugin_about* fclib_plugin_describe(void);

#ifdef __cplusplus
}
#endif

#endif /* FCLIB_PLUGIN_H */
