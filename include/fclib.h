/* fclib.h: frictional contact problems in HDF5 files, their merits and their solvers, from C.
 *
 * A drop-in for libfclib 3.1. It has every struct, field, constant and function of that library,
 * with the same layout and meaning. The shared library has the same SONAME, libfclib.so.0. What is
 * newer is marked as new.
 *
 * Problems
 *
 *   local     u = W r + V l + q,           V^T r + R l + s = 0
 *   global    M v = H r + G l + f,         u = H^T v + w,         G^T v + b = 0
 *
 *   n degrees of freedom, nc contacts, d = spacedim, m = d nc, p bilateral constraints. The terms
 *   with V, R, s or G, b, l are there if p > 0. For each contact, component 0 is normal (N) and the
 *   others are tangential (T), with u^ = u + [mu ||u_T||, 0, 0],
 *
 *       K* contains u^,   u^ . r = 0,   r in K = { ||r_T|| <= mu r_N }.
 *
 *   d is 2 or 3. With rolling (d is 3 or 5: N, T, R), K also asks for ||r_R|| <= mu_r r_N, and
 *   u^_N = u_N + mu ||u_T|| + mu_r ||u_R||. With spin (d is 4 or 6: N, T, S, R), K also asks for
 *   |r_S| <= mu_s r_N, or, coupled, for (||r_T|| / mu)^2 + (r_S / mu_s)^2 <= r_N^2.
 *
 * Errors
 *
 *   No function ends the process or throws. An int result is 1 on success and 0 on failure. On
 *   failure a pointer is NULL, and a merit is NaN. fclib_last_error() then has the reason, and the
 *   handler of fclib_set_error_handler() has been called with it. The default handler prints a line
 *   on the standard error. A NULL argument is an error, unless it is marked "or NULL".
 *
 * Ownership
 *
 *   What a read returns belongs to the caller. Its parts come from malloc. fclib_delete_local() and
 *   its like free the members; the caller then calls free() on the struct. fclib_delete_solutions()
 *   frees the members and the array. What a write takes stays the caller's, and is not changed.
 *
 * Files
 *
 *   A write is atomic: a process that is killed leaves the old file or the new one. (If the
 *   system has no files without a name, it leaves NAME.PID-1 too.) A new file takes the place of
 *   the old one, with its owner, permissions and extended attributes. A file with several names,
 *   or one that cannot be replaced so, is rewritten in place. A process that is killed meanwhile
 *   leaves NAME.fclib-journal, or one in $TMPDIR if the folder cannot be written. The next read
 *   or write by that name completes what the journal says.
 *
 *   A file may hold one problem of each kind, one solution, and any number of guesses. If it has
 *   several problems, the solution and the guesses belong to the global one. What is there already
 *   is replaced only if fclib_set_write_mode() says so.
 *
 * Threads
 *
 *   All functions may be called from several threads at once. Access to files is serialised, since
 *   HDF5 is not thread-safe. A host that calls HDF5 itself must not do so at the same time.
 *
 * The header-only mode of the sources of 3.1, FCLIB_HEADER_ONLY, is not offered. The library behind
 * this header is C++, and the packages of 3.1 never used that mode.
 */
#ifndef _fclib_h_
#define _fclib_h_

/* macros of 3.1, which clients may set or test */
#ifndef FCLIB_APICOMPILE
#define FCLIB_APICOMPILE
#endif
#ifndef FCLIB_NOT_HEADER_ONLY
#define FCLIB_NOT_HEADER_ONLY
#endif
#ifndef FCLIB_WITH_MERIT_FUNCTIONS
#define FCLIB_WITH_MERIT_FUNCTIONS
#endif
#ifndef H5Gcreate_vers
#define H5Gcreate_vers 2
#endif
#ifndef H5Gopen_vers
#define H5Gopen_vers 2
#endif

/* the version of this interface; for 3.1 it is 3.1 */
#define FCLIB_VERSION_MAJOR 3
#define FCLIB_VERSION_MINOR 2
#define FCLIB_VERSION_PATCH 0

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- data ------------------------------------------------------------------------------------ */

/** A problem in words. Each text, and the struct itself, may be NULL. */
struct FCLIB_APICOMPILE fclib_info {
  char* title;
  char* description; /**< where the problem comes from */
  char* math_info;   /**< known properties: existence, uniqueness, ... */
};

/** What is known of a matrix and cannot be seen from its entries. */
struct FCLIB_APICOMPILE fclib_matrix_info {
  char* comment; /**< or NULL */
  double conditioning;
  double determinant;
  int rank;
};

/** A matrix (m x n), index base 0, entries in any order.
 *
 *  nz    storage             p                            i                x
 *  >= 0  triplet             columns (nz)                 rows (nz)        (nz)
 *  -1    compressed columns  first entry of each (n + 1)  rows (nzmax)     (nzmax)
 *  -2    compressed rows     first entry of each (m + 1)  columns (nzmax)  (nzmax)
 *  -3    dense (new)         NULL                         NULL             (m n), by columns
 *
 *  Up to -2 this is the cs struct of CSparse, and may be cast to it. Triplets are as in CSparse,
 *  and as in all known files; a comment in the header of 3.1 says the reverse. Triplets at the same
 *  place add up. 3.1 does not know dense matrices, so reads return them by columns, without their
 *  zeros, unless fclib_keep_dense() says otherwise.
 */
struct FCLIB_APICOMPILE fclib_matrix {
  int nzmax; /**< how many entries fit; after a read, the length of x */
  int m;     /**< rows */
  int n;     /**< columns */
  int* p;
  int* i;
  double* x;
  int nz;
  struct fclib_matrix_info* info; /**< or NULL */
};

/** The global problem. M, H, f, w, mu are required. G and b are both there or both NULL. */
struct FCLIB_APICOMPILE fclib_global {
  struct fclib_matrix* M; /**< mass matrix, or matrix of an iteration (n x n) [kg] */
  struct fclib_matrix* H; /**< reactions to generalised forces (n x m) [1] */
  struct fclib_matrix* G; /**< bilateral multipliers to generalised forces (n x p) [1] */
  double* mu;             /**< coefficient of friction of each contact (nc) [1] */
  double* f;              /**< momentum without reactions (n) [N s] */
  double* b;              /**< prescribed velocity of the bilateral constraints (p) [m/s] */
  double* w;              /**< prescribed part of the contact velocity (m) [m/s] */
  int spacedim;           /**< components of a contact: 2 or 3 */
  struct fclib_info* info;
};

/** The local problem. W, q, mu are required. V, R and s are all there or all NULL. */
struct FCLIB_APICOMPILE fclib_local {
  struct fclib_matrix* W; /**< Delassus matrix, positive semi-definite (m x m) [1/kg] */
  struct fclib_matrix* V; /**< contact velocity under the bilateral multipliers (m x p) [1/kg] */
  struct fclib_matrix* R; /**< Delassus matrix of the bilateral constraints (p x p) [1/kg] */
  double* mu;             /**< coefficient of friction of each contact (nc) [1] */
  double* q;              /**< contact velocity without reactions (m) [m/s] */
  double* s;              /**< velocity of the bilateral constraints without reactions (p) [m/s] */
  int spacedim;           /**< components of a contact: 2 or 3 */
  struct fclib_info* info;
};

/** New. The global problem with rolling friction. */
struct FCLIB_APICOMPILE fclib_global_rolling {
  struct fclib_matrix* M;
  struct fclib_matrix* H;
  struct fclib_matrix* G;
  double* mu;
  double* mu_r; /**< coefficient of rolling friction of each contact (nc) [m] */
  double* f;
  double* b;
  double* w;
  int spacedim; /**< 3 (planar) or 5 */
  struct fclib_info* info;
};

/** New. The local problem with rolling friction. */
struct FCLIB_APICOMPILE fclib_local_rolling {
  struct fclib_matrix* W;
  struct fclib_matrix* V;
  struct fclib_matrix* R;
  double* mu;
  double* mu_r; /**< coefficient of rolling friction of each contact (nc) [m] */
  double* q;
  double* s;
  int spacedim; /**< 3 (planar) or 5 */
  struct fclib_info* info;
};

/** New. The global problem with spin friction, the resistance to turning about the normal. A
 * contact has the components N, T1, T2, S, or N, T1, T2, S, R1, R2 if it resists rolling too. */
struct FCLIB_APICOMPILE fclib_global_spin {
  struct fclib_matrix* M;
  struct fclib_matrix* H;
  struct fclib_matrix* G;
  double* mu;
  double* mu_s; /**< coefficient of spin friction of each contact (nc) [m] */
  double* mu_r; /**< coefficient of rolling friction (nc) [m], NULL if spacedim is 4 */
  double* f;
  double* b;
  double* w;
  int coupled;  /**< 1: sliding and spin share one limit, an ellipsoid (spacedim 4); 0: not */
  int spacedim; /**< 4 or 6 */
  struct fclib_info* info;
};

/** New. The local problem with spin friction, the resistance to turning about the normal. A contact
 *  has the components N, T1, T2, S, or N, T1, T2, S, R1, R2 if it resists rolling too. */
struct FCLIB_APICOMPILE fclib_local_spin {
  struct fclib_matrix* W;
  struct fclib_matrix* V;
  struct fclib_matrix* R;
  double* mu;
  double* mu_s; /**< coefficient of spin friction of each contact (nc) [m] */
  double* mu_r; /**< coefficient of rolling friction (nc) [m], NULL if spacedim is 4 */
  double* q;
  double* s;
  int coupled;  /**< 1: sliding and spin share one limit, an ellipsoid (spacedim 4); 0: not */
  int spacedim; /**< 4 or 6 */
  struct fclib_info* info;
};

/** A solution, or a guess. */
struct FCLIB_APICOMPILE fclib_solution {
  double* v; /**< generalised velocity (n), NULL for a local problem [m/s] */
  double* u; /**< relative velocity at the contacts (m) [m/s] */
  double* r; /**< reaction at the contacts (m), an impulse [N s] */
  double* l; /**< multiplier of the bilateral constraints (p), NULL if p = 0 [N s] */
};

/* ---- files ----------------------------------------------------------------------------------- */

/** Writes a problem into a new file, or adds it to an existing one. The file must not hold a
 *  problem of the same kind, unless fclib_set_write_mode() allows that. Values and indices are not
 *  checked: see fclib_validate_global(). Matrices keep their storage; Siconos reads a global
 *  problem only if it is in triplets. Returns 1, or 0. */
int fclib_write_global(struct fclib_global* problem, const char* path);
int fclib_write_local(struct fclib_local* problem, const char* path);
int fclib_write_global_rolling(struct fclib_global_rolling* problem, const char* path); /* new */
int fclib_write_local_rolling(struct fclib_local_rolling* problem, const char* path);   /* new */
int fclib_write_global_spin(struct fclib_global_spin* problem, const char* path);       /* new */
int fclib_write_local_spin(struct fclib_local_spin* problem, const char* path);         /* new */

/** Adds the solution of the problem that is in the file. Its arrays must have the lengths of that
 *  problem. Each may be NULL. If u or v is NULL, it follows from r (and l, if p > 0) by the
 *  problem. If r is NULL too, or the problem is not valid, u and v are zeros. If r or l is NULL, it
 *  is zeros. Returns 1, or 0. */
int fclib_write_solution(struct fclib_solution* solution, const char* path);

/** Adds guesses for the problem that is in the file (number_of_guesses structs). Their arrays may
 *  be NULL, as for a solution. Returns 1, or 0. */
int fclib_write_guesses(int number_of_guesses, struct fclib_solution* guesses, const char* path);

/** Reads a problem. Every array has the length that the structs above state. Values and indices are
 *  not checked. Returns NULL on failure. */
struct fclib_global* fclib_read_global(const char* path);
struct fclib_local* fclib_read_local(const char* path);
struct fclib_global_rolling* fclib_read_global_rolling(const char* path); /* new */
struct fclib_local_rolling* fclib_read_local_rolling(const char* path);   /* new */
struct fclib_global_spin* fclib_read_global_spin(const char* path);       /* new */
struct fclib_local_spin* fclib_read_local_spin(const char* path);         /* new */

/** Reads the solution. Its arrays have the lengths of the problem in the file. If the file lacks u
 *  or v, it follows from r. Returns NULL on failure, or if there is no solution. Free it with
 *  fclib_delete_solutions(solution, 1). */
struct fclib_solution* fclib_read_solution(const char* path);

/** Reads the guesses, and stores how many there are. Returns their array; free it with
 *  fclib_delete_solutions(guesses, number). Returns NULL on failure. If there are no guesses, it
 *  returns NULL without an error. */
struct fclib_solution* fclib_read_guesses(const char* path, int* number_of_guesses);

/** Gives an integer attribute to the info of the local problem in the file, or of another problem
 *  if there is no local one. Returns 1. Returns 0 if the attribute is there already and the write
 *  mode does not allow to replace it. */
int fclib_create_int_attributes_in_info(const char* path, const char* attr_name, int attr_value);

/** New. The kind of the problem that a solution of the file belongs to: "global", "local",
 *  "global_rolling", "local_rolling", "global_spin" or "local_spin". Do not free it. NULL if the
 * file holds no problem. */
const char* fclib_problem_kind(const char* path);

/** New. The lengths of that problem's arrays: degrees of freedom (0 for a local problem),
 *  components of the contacts, bilateral constraints, contacts. Each pointer may be NULL. Returns
 *  1, or 0. */
int fclib_problem_sizes(const char* path, int* n, int* m, int* p, int* nc);

/** New. What a write does if the file already holds such a thing. */
enum fclib_write_mode {
  FCLIB_WRITE_ADD,    /**< it fails, as in 3.1; the default */
  FCLIB_WRITE_REPLACE /**< it replaces the old one; with a problem, its solution and its guesses go
                           too */
};

/** New. Sets the mode of all writes of the process. Returns 1, or 0 for an unknown mode. */
int fclib_set_write_mode(enum fclib_write_mode mode);

/** New. Sets the level of compression of all writes of the process: 0 (none, as in 3.1) to 9. Level
 *  1 is for programs that write each step, 6 for archives. The default is what FCLIB_COMPRESSION in
 *  the environment says, else 0. Every HDF5 has the filters. Returns 1, or 0 for another level. */
int fclib_set_compression(int level);

/** New. Sets whether all reads of the process return dense matrices as they are (nz = -3), or by
 *  columns (keep = 0, the default). Returns 1. */
int fclib_keep_dense(int keep);

/* ---- deleting -------------------------------------------------------------------------------- */

/** Frees all members of a problem (or NULL), not the struct itself. */
void fclib_delete_global(struct fclib_global* problem);
void fclib_delete_local(struct fclib_local* problem);
void fclib_delete_global_rolling(struct fclib_global_rolling* problem); /* new */
void fclib_delete_local_rolling(struct fclib_local_rolling* problem);   /* new */
void fclib_delete_global_spin(struct fclib_global_spin* problem);       /* new */
void fclib_delete_local_spin(struct fclib_local_spin* problem);         /* new */

/** Frees the members of solutions or guesses (count structs), and the array (or NULL) itself. */
void fclib_delete_solutions(struct fclib_solution* data, int count);

/* ---- version --------------------------------------------------------------------------------- */

/** New. The version of the library that runs, "3.2.0". Do not free it. FCLIB_VERSION_MAJOR, _MINOR
 *  and _PATCH have the version of the header. */
const char* fclib_version(void);

/* ---- errors ---------------------------------------------------------------------------------- */

/** New. Why the last call of this thread failed, or "" if it did not fail. The text belongs to the
 *  library, and stays until the next call of this thread. */
const char* fclib_last_error(void);

/** New. Keeps a message for fclib_last_error() of this thread and calls the handler with it, as a
 *  call that fails does. For layers over this library, which check more, such as the Fortran
 *  module. */
void fclib_set_error(const char* message);

/** New. A function that gets every failure, in the thread in which it happens. It must return, and
 *  may call fclib. */
typedef void (*fclib_error_handler)(const char* message, void* context);

/** New. Installs a handler for the whole process, in place of the default one, and the context for
 *  its calls. With NULL the library is silent. */
void fclib_set_error_handler(fclib_error_handler handler, void* context);

/* ---- validation ------------------------------------------------------------------------------ */

/** New. Checks whether the data of a problem makes sense: sizes that agree, pointers in order,
 *  indices in range, finite numbers, no negative friction. Returns 1, or 0 with the first fault.
 *  Merits and solves do this first. */
int fclib_validate_global(const struct fclib_global* problem);
int fclib_validate_local(const struct fclib_local* problem);
int fclib_validate_global_rolling(const struct fclib_global_rolling* problem);
int fclib_validate_local_rolling(const struct fclib_local_rolling* problem);
int fclib_validate_global_spin(const struct fclib_global_spin* problem);
int fclib_validate_local_spin(const struct fclib_local_spin* problem);

/** New. Checks whether the members of a solution are finite, and whether the required ones are
 *  there: r, and l if p > 0. Returns 1, or 0. */
int fclib_validate_global_solution(const struct fclib_global* problem,
                                   const struct fclib_solution* solution);
int fclib_validate_local_solution(const struct fclib_local* problem,
                                  const struct fclib_solution* solution);
int fclib_validate_global_rolling_solution(const struct fclib_global_rolling* problem,
                                           const struct fclib_solution* solution);
int fclib_validate_local_rolling_solution(const struct fclib_local_rolling* problem,
                                          const struct fclib_solution* solution);
int fclib_validate_global_spin_solution(const struct fclib_global_spin* problem,
                                        const struct fclib_solution* solution);
int fclib_validate_local_spin_solution(const struct fclib_local_spin* problem,
                                       const struct fclib_solution* solution);

/* ---- merits ---------------------------------------------------------------------------------- */

/** How wrong a solution is. u is always recomputed: W r + V l + q, or H^T v + w.
 *
 *  MERIT_1   ||F|| / (1 + sqrt(||q||)) + ||V^T r + R l + s|| / (1 + ||s||) with the natural map
 *            F = r - P_K(r - u^), in double precision. It is the number of 3.1, which has it only
 *            for matrices by columns and d = 3. For a global problem q = H^T M^-1 f + w, the second
 *            term is ||G^T v + b|| / (1 + ||b||), and there is a third one,
 *            ||M v - H r - G l - f|| / (1 + ||f||).
 *  MERIT_2   the relative error that every tolerance of this library bounds (3.1 returns 0). It is
 *            the largest of three errors: ||F|| / ||q||; the same with rho u^ for u^ and rho q for
 *            q, rho = 1 / mean |W_kk|, which does not change with the units; and the errors of the
 *            stored v, u and l, each component relative to its own velocity. Errors that
 *            rounding of the terms explains do not count.
 */
enum FCLIB_APICOMPILE fclib_merit { MERIT_1, MERIT_2 };

#ifdef FCLIB_WITH_MERIT_FUNCTIONS
/** The merit of a solution. It needs r, and l if p > 0. If v is NULL, it follows from them. NaN if
 *  the problem or the solution is not valid. */
double fclib_merit_global(struct fclib_global* problem, enum fclib_merit merit,
                          struct fclib_solution* solution);
double fclib_merit_local(struct fclib_local* problem, enum fclib_merit merit,
                         struct fclib_solution* solution);
double fclib_merit_global_rolling(struct fclib_global_rolling* problem, enum fclib_merit merit,
                                  struct fclib_solution* solution); /* new */
double fclib_merit_local_rolling(struct fclib_local_rolling* problem, enum fclib_merit merit,
                                 struct fclib_solution* solution); /* new */
double fclib_merit_global_spin(struct fclib_global_spin* problem, enum fclib_merit merit,
                               struct fclib_solution* solution); /* new */
double fclib_merit_local_spin(struct fclib_local_spin* problem, enum fclib_merit merit,
                              struct fclib_solution* solution); /* new */
#endif

/* ---- solving --------------------------------------------------------------------------------- */

/** New. What a caller asks of a solver. A struct of zeros asks for the defaults. */
struct fclib_solve_options {
  double tolerance;    /**< on MERIT_2, finite; 0 for 1e-8 */
  int max_iterations;  /**< 0 for the solver's own */
  double time_limit;   /**< wall clock [s]; 0 for none */
  const double* guess; /**< reactions to start from (m), or NULL */
  const char* options; /**< options of the solver, "name=value name=\"a text\"", or NULL */
  /** (nc) and (p), or NULL. If the status is FCLIB_INFEASIBLE, they get a proof that there is no
   *  solution; see fclib_certificate_global() */
  double* certificate_y;
  double* certificate_z;
};

/** New. How a solve ended. */
enum fclib_status {
  FCLIB_CONVERGED,       /**< MERIT_2 is at most the tolerance */
  FCLIB_ITERATION_LIMIT, /**< stopped at max_iterations */
  FCLIB_TIME_LIMIT,      /**< stopped at time_limit */
  FCLIB_DIVERGED,        /**< an iterate was not finite */
  FCLIB_INACCURATE,      /**< the solver said it was done, but MERIT_2 is above the tolerance */
  FCLIB_INTERRUPTED,
  FCLIB_STALLED,    /**< the solver has nothing left to try; its best iterate is returned */
  FCLIB_INFEASIBLE, /**< there is no solution, and the solver has proven it */
  FCLIB_INVALID     /**< of a problem in a batch: its data are not valid */
};

/** New. The results of a solve besides the solution. */
struct fclib_solve_result {
  enum fclib_status status;
  int iterations;
  double error; /**< MERIT_2 of the solution */
  double cpu_s; /**< CPU time of the solver alone [s] */
  /** if the status is FCLIB_INFEASIBLE, the bound of the certificate, as from
   *  fclib_certificate_global(); else 0 */
  double certificate_bound;
};

/** New. Solves a problem with the solver of this name (see fclib_solver_name()). The arrays of
 *  `solution` are the caller's, with the lengths that struct states. They are filled; v, u and l
 *  may be NULL. `options` and `result` may be NULL. Returns 1 if the solver ran, however it ended,
 *  and 0 for invalid data, or an unknown solver or option. */
int fclib_solve_global(const struct fclib_global* problem, const char* solver,
                       const struct fclib_solve_options* options, struct fclib_solution* solution,
                       struct fclib_solve_result* result);
int fclib_solve_local(const struct fclib_local* problem, const char* solver,
                      const struct fclib_solve_options* options, struct fclib_solution* solution,
                      struct fclib_solve_result* result);
int fclib_solve_global_rolling(const struct fclib_global_rolling* problem, const char* solver,
                               const struct fclib_solve_options* options,
                               struct fclib_solution* solution, struct fclib_solve_result* result);
int fclib_solve_local_rolling(const struct fclib_local_rolling* problem, const char* solver,
                              const struct fclib_solve_options* options,
                              struct fclib_solution* solution, struct fclib_solve_result* result);
int fclib_solve_global_spin(const struct fclib_global_spin* problem, const char* solver,
                            const struct fclib_solve_options* options,
                            struct fclib_solution* solution, struct fclib_solve_result* result);
int fclib_solve_local_spin(const struct fclib_local_spin* problem, const char* solver,
                           const struct fclib_solve_options* options,
                           struct fclib_solution* solution, struct fclib_solve_result* result);

/** New. What y >= 0 (nc) and z (p; NULL for zeros) prove: no reactions with a norm below the result
 *  are a solution. INFINITY: there is no solution. 0: nothing is proven. NaN: the problem, y or z
 *  is not valid. Let E y be the vector whose normal parts are y. It is a proof if
 *
 *    local    -(W^T E y + V z) is in K*,  V^T E y + R^T z = 0,  y . q_N + z . s < 0
 *    global   H E y + G z = 0,                                  y . w_N + z . b < 0
 *
 *  (Farkas' lemma; docs/mathematics.md). All sums are exact. For a global problem it is enough if
 *  real numbers next to y and z are a proof. */
double fclib_certificate_global(const struct fclib_global* problem, const double* y,
                                const double* z);
double fclib_certificate_local(const struct fclib_local* problem, const double* y, const double* z);
double fclib_certificate_global_rolling(const struct fclib_global_rolling* problem, const double* y,
                                        const double* z);
double fclib_certificate_local_rolling(const struct fclib_local_rolling* problem, const double* y,
                                       const double* z);
double fclib_certificate_global_spin(const struct fclib_global_spin* problem, const double* y,
                                     const double* z);
double fclib_certificate_local_spin(const struct fclib_local_spin* problem, const double* y,
                                    const double* z);

/** New. The name of solver number k = 0, 1, ..., or NULL after the last. Do not free it. */
const char* fclib_solver_name(int k);

/** New. "converged", "iteration_limit", ... Do not free it. */
const char* fclib_status_name(enum fclib_status status);

/* ---- by name --------------------------------------------------------------------------------- */

/** New. Settings by name. Later versions may have more of them. A program has only a pointer. Many
 *  calls may use one, in several threads at once, as long as none changes it.
 *
 *  a solve   "solver" ("auto"), "tolerance" (1e-8), "max_iterations" (0: the solver's own),
 *            "time_limit" ([s], 0: none), "merit" ("both", or "natural": without the scaled map),
 *            the options of the solver, the array "guess" (m reactions to start from), and a
 *            function that is told of the progress
 *  a write   "mode" ("add", "replace"), "compression" (0 to 9): in the place of what
 *            fclib_set_write_mode() and fclib_set_compression() have set for all
 *
 *  A name that the call does not know is an error of that call. */
struct fclib_options;
struct fclib_options* fclib_options_create(void);
void fclib_options_delete(struct fclib_options* options); /* or NULL */

/** New. Sets one thing, and replaces its old value. Texts, numbers and arrays are copied. Any
 *  setting may be given as a text. Returns 1, or 0. */
int fclib_options_set_text(struct fclib_options* options, const char* name, const char* value);
int fclib_options_set_number(struct fclib_options* options, const char* name, double value);
int fclib_options_set_array(struct fclib_options* options, const char* name, const double* values,
                            int count);

/** New. A function that is told how a solve goes: iterations, error (the solver's own), wall clock
 *  [s], and the method at work ("" if the solver has only one). The thread that solves calls it. If
 *  it returns anything but 0, the solve ends as FCLIB_INTERRUPTED with what it has. */
typedef int (*fclib_progress)(int iteration, double error, double time, const char* stage,
                              void* context);

/** New. Sets that function, or NULL, and the context for its calls. Returns 1, or 0. */
int fclib_options_set_progress(struct fclib_options* options, fclib_progress progress,
                               void* context);

/** New. The results of a call, by name. Later versions may have more names. */
struct fclib_report;
void fclib_report_delete(struct fclib_report* report); /* or NULL */

/** New. A number, a text or an array of a report. The pointers belong to the report. NaN or NULL if
 *  there is none of this name. An array may have no entries; its pointer is not NULL then. */
double fclib_report_number(const struct fclib_report* report, const char* name);
const char* fclib_report_text(const struct fclib_report* report, const char* name);
const double* fclib_report_array(const struct fclib_report* report, const char* name, int* count);

/** New. Solves a problem as the options (or NULL) say. The report has the numbers "error",
 *  "iterations", "status" (of enum fclib_status), "cpu_s" (CPU time of the solver alone [s]),
 *  "time" (its wall clock [s]), "setup_s", "certificate_bound"; the texts "status" and "solver";
 *  the arrays "v", "u", "r", "l", "certificate_y", "certificate_z". Delete it with
 *  fclib_report_delete(). NULL for invalid data, or an unknown solver or option. */
struct fclib_report* fclib_solve_global_with(const struct fclib_global* problem,
                                             const struct fclib_options* options);
struct fclib_report* fclib_solve_local_with(const struct fclib_local* problem,
                                            const struct fclib_options* options);
struct fclib_report* fclib_solve_global_rolling_with(const struct fclib_global_rolling* problem,
                                                     const struct fclib_options* options);
struct fclib_report* fclib_solve_local_rolling_with(const struct fclib_local_rolling* problem,
                                                    const struct fclib_options* options);
struct fclib_report* fclib_solve_global_spin_with(const struct fclib_global_spin* problem,
                                                  const struct fclib_options* options);
struct fclib_report* fclib_solve_local_spin_with(const struct fclib_local_spin* problem,
                                                 const struct fclib_options* options);

/** New. The parts of MERIT_2, as numbers: "error" (all of it), "natural", "scaled_natural",
 *  "dynamics", "bilateral", "kinematics"; "cone", "dual_cone" and "complementarity", each the
 *  largest of all contacts; and how many contacts are "open", "stick" and "slide". Delete the
 *  report with fclib_report_delete(). NULL if the problem or the solution is not valid. */
struct fclib_report* fclib_judge_global(const struct fclib_global* problem,
                                        const struct fclib_solution* solution);
struct fclib_report* fclib_judge_local(const struct fclib_local* problem,
                                       const struct fclib_solution* solution);
struct fclib_report* fclib_judge_global_rolling(const struct fclib_global_rolling* problem,
                                                const struct fclib_solution* solution);
struct fclib_report* fclib_judge_local_rolling(const struct fclib_local_rolling* problem,
                                               const struct fclib_solution* solution);
struct fclib_report* fclib_judge_global_spin(const struct fclib_global_spin* problem,
                                             const struct fclib_solution* solution);
struct fclib_report* fclib_judge_local_spin(const struct fclib_local_spin* problem,
                                            const struct fclib_solution* solution);

/** New. Write like fclib_write_global() and its like, fclib_write_solution() and
 *  fclib_write_guesses(), with the options (or NULL) of this call. Return 1, or 0. */
int fclib_write_global_with(const struct fclib_global* problem, const char* path,
                            const struct fclib_options* options);
int fclib_write_local_with(const struct fclib_local* problem, const char* path,
                           const struct fclib_options* options);
int fclib_write_global_rolling_with(const struct fclib_global_rolling* problem, const char* path,
                                    const struct fclib_options* options);
int fclib_write_local_rolling_with(const struct fclib_local_rolling* problem, const char* path,
                                   const struct fclib_options* options);
int fclib_write_global_spin_with(const struct fclib_global_spin* problem, const char* path,
                                 const struct fclib_options* options);
int fclib_write_local_spin_with(const struct fclib_local_spin* problem, const char* path,
                                const struct fclib_options* options);
int fclib_write_solution_with(const struct fclib_solution* solution, const char* path,
                              const struct fclib_options* options);
int fclib_write_guesses_with(int number_of_guesses, const struct fclib_solution* guesses,
                             const char* path, const struct fclib_options* options);

/** New. "title", "family" or "citation" of a solver. Do not free it. NULL on failure. */
const char* fclib_solver_text(const char* solver, const char* what);

/** New. A property of option number k = 0, 1, ... of a solver: "name", "type" ("bool", "int",
 *  "float", "choice", "text"), "default", "unit", "doc", "lowest", "highest" or "choices" (a list
 *  with commas). The text belongs to the library, and stays until the next call of this function in
 *  this thread. NULL after the last option, and on failure. */
const char* fclib_option_text(const char* solver, int k, const char* what);

/* ---- converting ------------------------------------------------------------------------------ */

/** New. The local problem of a global one: W = H^T M^-1 H, q = H^T M^-1 f + w, and V, R, s from G
 *  and b. Delete and free it. NULL if the problem is not valid, or if M is singular. */
struct fclib_local* fclib_condense_global(const struct fclib_global* problem);
struct fclib_local_rolling* fclib_condense_global_rolling(
    const struct fclib_global_rolling* problem);
struct fclib_local_spin* fclib_condense_global_spin(const struct fclib_global_spin* problem);

/** New. Fills u and v, or the one of them that is not NULL, with what follows from r (and l, if p >
 *  0). So it turns a solution of the condensed problem into one of the global problem. Returns 1,
 *  or 0. */
int fclib_complete_global(const struct fclib_global* problem, struct fclib_solution* solution);
int fclib_complete_local(const struct fclib_local* problem, struct fclib_solution* solution);
int fclib_complete_global_rolling(const struct fclib_global_rolling* problem,
                                  struct fclib_solution* solution);
int fclib_complete_local_rolling(const struct fclib_local_rolling* problem,
                                 struct fclib_solution* solution);
int fclib_complete_global_spin(const struct fclib_global_spin* problem,
                               struct fclib_solution* solution);
int fclib_complete_local_spin(const struct fclib_local_spin* problem,
                              struct fclib_solution* solution);

/** New. Read and write the text format (.dat) of Siconos, which has no bilateral constraints. A
 *  write replaces the file. On failure a read returns NULL, a write 0. */
struct fclib_global* fclib_read_siconos_global(const char* path);
int fclib_write_siconos_global(const struct fclib_global* problem, const char* path);
struct fclib_local* fclib_read_siconos_local(const char* path);
int fclib_write_siconos_local(const struct fclib_local* problem, const char* path);
struct fclib_global_rolling* fclib_read_siconos_global_rolling(const char* path);
int fclib_write_siconos_global_rolling(const struct fclib_global_rolling* problem,
                                       const char* path);
struct fclib_local_rolling* fclib_read_siconos_local_rolling(const char* path);
int fclib_write_siconos_local_rolling(const struct fclib_local_rolling* problem, const char* path);
struct fclib_global_spin* fclib_read_siconos_global_spin(const char* path);
int fclib_write_siconos_global_spin(const struct fclib_global_spin* problem, const char* path);
struct fclib_local_spin* fclib_read_siconos_local_spin(const char* path);
int fclib_write_siconos_local_spin(const struct fclib_local_spin* problem, const char* path);

/* ---- pictures -------------------------------------------------------------------------------- */

/** New. The kinds of shapes, and what their three sizes are. A shape lies around the origin of its
 *  frame. */
enum fclib_shape {
  FCLIB_PLANE,     /**< z = 0, z is up; half edges of what is to be drawn, 0 if it has no end */
  FCLIB_SPHERE,    /**< radius */
  FCLIB_CAPSULE,   /**< radius, half length along z without the caps */
  FCLIB_ELLIPSOID, /**< half axes */
  FCLIB_CYLINDER,  /**< radius, half length along z */
  FCLIB_BOX,       /**< half edges */
  FCLIB_MESH       /**< none: its vertices define it */
};

/** New. Where the contacts of a problem are, and the bodies that touch there. Pictures show it
 *  (`fclib view FILE`); no solver uses it. The arrays are the caller's, and by rows. Lengths are in
 *  m unless `unit` says otherwise. Turns are unit quaternions w, x, y, z. Numbers of bodies, shapes
 *  and meshes count from 0. Later versions may add members at the end: set the struct to zeros
 *  first, and `size` to sizeof(struct fclib_geometry). */
struct fclib_geometry {
  size_t size;
  int nc;                  /**< contacts, in the order of the problem */
  const int* body;         /**< (nc x 2) the two; the normal points from the first to the second */
  const int* shape;        /**< (nc x 2) their shapes that touch, -1 for the limit of a joint; NULL:
                                the first shape of each body */
  const int* feature;      /**< (nc) which contact of these two shapes it is, or NULL: 0, 1, ... */
  const double* point;     /**< (nc x 3) midway between the two surfaces, in the world */
  const double* normal;    /**< (nc x 3) N, 0 for the limit of a joint */
  const double* tangent;   /**< (nc x 3) T1; T2 is N x T1. In the plane T1 is T */
  const double* gap;       /**< (nc) signed distance, negative if they overlap; or NULL: 0 */
  int nb;                  /**< bodies */
  const char* const* name; /**< (nb) each one line, or NULL: "1", "2", ... */
  const int* moves;        /**< (nb) 1 if something can move it, 0 if it is fixed */
  const double* place;     /**< (nb x 3) of the body's frame in the world */
  const double* turn;      /**< (nb x 4) of the body's frame, or NULL: not turned */
  int ns;                  /**< shapes */
  const int* shape_body;   /**< (ns) the body of each, or NULL: shape k is that of body k */
  const int* shape_kind;   /**< (ns) of enum fclib_shape */
  const double* shape_size;  /**< (ns x 3) as fclib_shape says, the others 0 */
  const double* shape_place; /**< (ns x 3) of its frame in its body, or NULL: 0 */
  const double* shape_turn;  /**< (ns x 4) of its frame in its body, or NULL: not turned */
  const int* shape_mesh;     /**< (ns) its mesh, -1 for another kind, or NULL: no meshes */
  int nm;                    /**< meshes */
  const int*
      mesh_first;       /**< ((nm + 1) x 2) first vertex and first face of each; last the numbers */
  const double* vertex; /**< (x 3) of all meshes, in the frame of the shape */
  const int* face;      /**< (x 4) vertices of a face, counted in its mesh, about the outward
                             normal; -1 last: three only */
  const double* displacement; /**< (x 3) of the vertices of an elastic body, or NULL */
  const double* period;       /**< (2) edges of a cell that repeats along x and y, or NULL */
  int planar;                 /**< 1 if all moves in the plane x, z */
  const char* unit;           /**< of lengths, or NULL: m */
  const char* mass_unit;      /**< of masses, or NULL: kg */
  const double* mass;         /**< (nb) of each rigid body, 0 if it is fixed, or NULL */
  const double* inertia;      /**< (nb x 3) principal moments about its centre, or NULL */
  const double* center;       /**< (nb x 3) centre of mass in its frame, or NULL */
  const double* axes;         /**< (nb x 4) turn of its principal axes in its frame, or NULL */
  int n;                      /**< components of velocity and impulse, 0 without them */
  const double* velocity;     /**< (n) generalised, at the start of the step, or NULL */
  const double* impulse;      /**< (n) of all known forces, f = M velocity + impulse, or NULL */
};

/** New. Adds a geometry to a file that has a problem of nc contacts. Returns 1. Returns 0 if
 *  numbers contradict each other, or if the file has a geometry already and the write mode does not
 *  allow to replace it. */
int fclib_write_geometry(const struct fclib_geometry* geometry, const char* path);
int fclib_write_geometry_with(const struct fclib_geometry* geometry, const char* path,
                              const struct fclib_options* options);

/* ---- many problems in one file --------------------------------------------------------------- */

/** New. A sequence: the problems of a simulation, or of several worlds, in one file that grows step
 *  by step. Step k = 0, 1, ... of "run.h5" is a file to all functions that read:
 *
 *      struct fclib_local* problem = fclib_read_local("run.h5#17");
 *
 *  libfclib 3.1 does not read sequences. `fclib convert` writes their steps as files that it reads.
 *
 *  A step begins with its problem; its solution, guesses and geometry may follow. It ends where the
 *  next one begins, or at a flush. Steps are confirmed by fclib_sequence_flush(), or by the first
 *  step that ends a tenth of a second later, or after a MiB. What is confirmed stays if the process
 *  is killed at any moment, and other programs can read it meanwhile. Values and indices are not
 *  checked. An array that is equal to the one before it in its world is stored once. */
struct fclib_sequence;

/** New. A new file, in the place of one that is there. Of the options (or NULL) of a write it takes
 *  "compression". NULL on failure, or if another program writes to the file. */
struct fclib_sequence* fclib_sequence_create(const char* path, const struct fclib_options* options);

/** New. Goes on with a sequence that is there, also after its writer was killed. NULL on failure.
 */
struct fclib_sequence* fclib_sequence_continue(const char* path);

/** New. Begins a step of a world (0 if there is only one). Returns 1, or 0. */
int fclib_sequence_add_global(struct fclib_sequence* sequence, const struct fclib_global* problem,
                              int world);
int fclib_sequence_add_local(struct fclib_sequence* sequence, const struct fclib_local* problem,
                             int world);
int fclib_sequence_add_global_rolling(struct fclib_sequence* sequence,
                                      const struct fclib_global_rolling* problem, int world);
int fclib_sequence_add_local_rolling(struct fclib_sequence* sequence,
                                     const struct fclib_local_rolling* problem, int world);
int fclib_sequence_add_global_spin(struct fclib_sequence* sequence,
                                   const struct fclib_global_spin* problem, int world);
int fclib_sequence_add_local_spin(struct fclib_sequence* sequence,
                                  const struct fclib_local_spin* problem, int world);

/** New. Add to the step. If the call that was to add its problem failed, there is none. A solution
 *  and guesses need r, and l if p > 0; v and u may be NULL. Return 1, or 0. */
int fclib_sequence_add_solution(struct fclib_sequence* sequence,
                                const struct fclib_solution* solution);
int fclib_sequence_add_guesses(struct fclib_sequence* sequence, int number_of_guesses,
                               const struct fclib_solution* guesses);
int fclib_sequence_add_geometry(struct fclib_sequence* sequence,
                                const struct fclib_geometry* geometry);

/** New. Ends the step and confirms all steps. Returns 1, or 0. */
int fclib_sequence_flush(struct fclib_sequence* sequence);

/** New. The same; then the disk has them, and the sequence (or NULL) is freed. Returns 1. Returns 0
 *  if they could not be written; it is freed all the same. */
int fclib_sequence_close(struct fclib_sequence* sequence);

/** New. How many confirmed steps a file has; -1 on failure, or if it is no sequence. */
int fclib_sequence_size(const char* path);

/* ---- many small problems --------------------------------------------------------------------- */

/** New. Problems of a few contacts, one after another in the caller's arrays: local ones, u = W r +
 *  q, or global ones, M v = H r + f and u = H^T v + w. Later versions may add members at the end:
 *  set the struct to zeros first, and `size` to sizeof(struct fclib_batch). */
struct fclib_batch {
  size_t size;
  int spacedim;        /**< 2 or 3; 3 or 5 with mu_r, 4 with mu_s, 6 with both */
  int count;           /**< problems */
  const int* nc;       /**< contacts of each (count), or NULL: nc_each */
  int nc_each;         /**< contacts of every problem, if nc is NULL */
  const double* W;     /**< of each problem m x m by rows, m = spacedim nc; or blocks, see starts */
  const double* q;     /**< of each m */
  const double* mu;    /**< of each nc */
  const double* guess; /**< reactions to start from, of each m, or NULL */
  double tolerance;    /**< on MERIT_2 of each; 0 for 1e-8 */
  int threads;       /**< that share the batch, 0 or 1 for none beside the caller's, -1 for as many
                          as the machine has; the result is the same */
  double time_limit; /**< wall clock of the whole batch [s]; 0 for none */
  /* results in the caller's arrays; all but r may be NULL */
  double* r;                 /**< of each m */
  double* u;                 /**< of each m: W r + q */
  enum fclib_status* status; /**< (count) */
  double* error;             /**< (count) at least MERIT_2, and at most a thousandth of the
                                  tolerance above it */
  int* iterations;           /**< (count) */
  /* W by blocks of spacedim x spacedim, each by rows, if starts is not NULL: row of blocks by row
     of blocks. Contacts that no block connects are solved apart from each other. */
  const int* starts;  /**< of each nc + 1: the first block of each contact, and their number */
  const int* columns; /**< of each block the other contact */
  int one_pattern;    /**< not 0: starts and columns are there once, for all problems */
  /* global problems, if M is not NULL: W and q are then NULL */
  const int* n;         /**< degrees of freedom of each (count), or NULL: n_each */
  int n_each;           /**< ... of every problem, if n is NULL */
  const double* M;      /**< of each n x n, symmetric */
  const double* H;      /**< of each n x m by columns, which is the Jacobian H^T by rows */
  const double* f;      /**< of each n */
  const double* w_free; /**< w, of each m, or NULL for zeros */
  double* v;            /**< result: of each n; may be NULL */
  /* other laws than Coulomb's: the solver "auto" solves each of these problems */
  const double* mu_r; /**< coefficient of rolling friction, of each nc [m], or NULL */
  const double* mu_s; /**< coefficient of spin friction, of each nc [m], or NULL */
  int coupled;        /**< 1: sliding and spin share one limit, an ellipsoid (spacedim 4); 0: not */
};

/** New. Solves all problems of a batch. Small ones have a method of their own, which allocates
 *  nothing once its thread has seen the largest problem. The solver "auto" gets those that this
 *  method does not solve. Returns 1 if all were tried, however they ended. A problem with an entry
 *  that is not finite, a negative mu, or an M that is not positive definite has the status
 *  FCLIB_INVALID, and NaN for r, u and v; the others have their answers all the same. If status is
 *  NULL, such a problem makes the call return 0, with a message that names it. */
int fclib_solve_batch(const struct fclib_batch* batch);

/** New. How the solutions of a batch of local problems change with their data. Set the struct to
 *  zeros first, and `size` to sizeof(struct fclib_derivatives). */
struct fclib_derivatives {
  size_t size;
  int spacedim;     /**< 2 or 3 */
  int count;        /**< problems */
  const int* nc;    /**< contacts of each (count), or NULL: nc_each */
  int nc_each;      /**< contacts of every problem, if nc is NULL */
  const double* W;  /**< of each problem m x m by rows, m = spacedim nc */
  const double* q;  /**< of each m */
  const double* mu; /**< of each nc */
  const double* r;  /**< of each m: the solutions, to a tolerance far below 1e-6 */
  int threads;      /**< as in fclib_batch */
  int sides;        /**< right-hand sides of each problem, one after another; 0 for 1 */
  /* fclib_batch_jvp reads the changes of the data and fills those of the solution; fclib_batch_vjp
     reads the weights of r and u and fills the derivatives of their sum by the data. What is NULL
     is zero, or not asked for. */
  double* dW;  /**< of each, sides times m x m by rows; its entries count as independent */
  double* dq;  /**< of each, sides times m */
  double* dmu; /**< of each, sides times nc */
  double* dr;  /**< of each, sides times m */
  double* du;  /**< of each, sides times m */
  unsigned char* degenerate; /**< result: of each nc, or NULL: 1 if the contact is on a border
                                  between two statuses, where one of two derivatives is taken */
  unsigned char* unique;     /**< result: (count), or NULL: 0 if the change of r is not determined;
                                  one of them is given */
};

/** New. Derivatives in adjoint mode, and in forward mode. One factorisation serves all sides of a
 *  problem. A problem with data that are not valid gets NaN, but zero weights or changes give
 * zeros. Return 1, and 0 for sizes that make no sense. */
int fclib_batch_vjp(const struct fclib_derivatives* derivatives);
int fclib_batch_jvp(const struct fclib_derivatives* derivatives);

/* ---- one solve after another ----------------------------------------------------------------- */

/** New. What a simulation keeps between its solves: memory, and the reactions of its contacts. For
 *  one thread at a time. */
struct fclib_workspace;

/** New. NULL if there is not enough memory. Delete it with fclib_workspace_delete(). */
struct fclib_workspace* fclib_workspace_new(void);

/** New. Frees a workspace (or NULL). */
void fclib_workspace_delete(struct fclib_workspace* workspace);

/** New. Solves a local problem without bilateral constraints to a tolerance on MERIT_2 (0 for
 *  1e-8). `contacts` (nc, or NULL) are names that contacts keep from one problem to the next: the
 *  solve starts from the reactions that those names had. Fills r (m), and those of u (m), status
 *  and error that are not NULL. Once the workspace has seen the largest problem, no memory is
 *  allocated unless the solver "auto" is needed. Returns 1 however it ended, and 0 for invalid
 *  data. */
int fclib_workspace_solve(struct fclib_workspace* workspace, const struct fclib_local* problem,
                          const size_t* contacts, double tolerance, double* r, double* u,
                          enum fclib_status* status, double* error);

/** New. The next solve starts from zero again. The memory stays. NULL is an error. */
void fclib_workspace_forget(struct fclib_workspace* workspace);

#ifdef __cplusplus
}
#endif

#endif /* _fclib_h_ */
