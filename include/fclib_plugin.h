/* fclib_plugin.h: your own solvers in C or C++, as a shared object that fclib loads.
 *
 *   cc -O2 -shared -fPIC mine.c -o libmine.so
 *   fclib solve problem.hdf5 --solver plugin:./libmine.so
 *
 * The shared object exports the function fclib_plugin_solve(). It may export
 * fclib_plugin_describe(), which describes its options. The library loads it when "plugin:PATH" is
 * given as a solver: in C, C++, Python and on the command line. Whatever the user's problem is, the
 * plugin gets a local problem without bilateral constraints,
 *
 *   u = W r + q,   K* contains u^,   u^ . r = 0,   r in K,
 *
 * in the conventions of fclib.h, and the starting point in r. It must call stop() in every
 * iteration, and leave its best iterate in r. It is run and judged like the solvers of fclib: the
 * error is recomputed from r, and stop() enforces the limits.
 */
#ifndef FCLIB_PLUGIN_H
#define FCLIB_PLUGIN_H

#ifdef __cplusplus
extern "C" {
#endif

/** What a plugin gets. The arrays belong to fclib, and do not change during the call. Later
 *  versions add members only at the end; size tells which are there. */
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
  /** Whether it is time to stop: r is within the tolerance, or a limit is reached. Call it in every
   *  iteration. */
  int (*stop)(void* context, const double* r);
  void* context;      /**< for stop(), number() and text() */
  const double* mu_r; /**< (nc) [m], of rolling friction; NULL if there is none */
  /** The value of an option: 0 or 1 for a bool, the position for a choice. NaN if there is none. */
  double (*number)(void* context, const char* name);
  /** The value of a choice or a text, valid until the call ends. NULL if there is none. */
  const char* (*text)(void* context, const char* name);
};

/** An option of a plugin. Users give it by its name. Members that it does not need may be 0 or
 *  NULL. */
struct fclib_plugin_option {
  const char* name;  /**< NULL ends the list */
  const char* type;  /**< "bool", "int", "float", "choice" or "text" */
  const char* value; /**< the default, in words: "true", "20", "1.5" */
  const char* unit;
  const char* doc;            /**< what it means, in a line */
  const char* const* choices; /**< for a choice: its values, then NULL */
  double lowest;              /**< for a number; no bounds if both are 0 */
  double highest;
};

/** The description of a plugin. */
struct fclib_plugin_about {
  int size;                                  /**< of this struct, in bytes */
  int rolling;                               /**< 1: it takes problems of rolling friction too */
  const char* title;                         /**< a line, or NULL */
  const char* citation;                      /**< or NULL */
  const struct fclib_plugin_option* options; /**< or NULL */
};

/** What the shared object exports. On entry r (m) is the starting point, on return the solution.
 *  Returns 0, or another number if it cannot solve such a problem: the call is then an error. */
int fclib_plugin_solve(const struct fclib_plugin_problem* problem, double* r);

/** What the shared object may export: its description, valid as long as it is loaded. */
const struct fclib_plugin_about* fclib_plugin_describe(void);

#ifdef __cplusplus
}
#endif

#endif /* FCLIB_PLUGIN_H */
