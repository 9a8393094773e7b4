// FCLIB in a browser or in Node: problems, merits and solvers of frictional contact.
//
//   import { load } from "./fclib.js";
//   const fclib = await load();
//   const result = fclib.solve(problem, { solver: "auto", tol: 1e-8 });
//
// Names are those of Python (docs/browser.md, fclib.d.ts). Problems are plain objects whose vectors
// are Float64Array and whose matrices are { storage, rows, cols, p, i, x }. Calls do not return
// before they are done: for a page that stays alive there is fclib-worker.js.

/** What the core says is wrong. `kind`: file, problem, option, unsuitable, memory or internal. */
export class FclibError extends Error {
  constructor(kind, message, where = "") {
    super(message);
    this.name = "FclibError";
    this.kind = kind;
    this.where = where;
  }
}

const settings_of_solve = {
  solver: "auto",
  tol: 1e-8,
  max_iterations: null,
  time_limit: null,
  guess: null,
  merit: "both",
  history: false,
  clock: null,
  options: {},
};

/** The settings of a solve with their defaults, checked as fclib.solve of Python does. */
function complete(given) {
  const refuse = (message) => {
    throw new FclibError("option", message);
  };
  for (const name of Object.keys(given)) {
    if (!(name in settings_of_solve)) {
      refuse(`${name}: unknown; there is: ${Object.keys(settings_of_solve).join(", ")}`);
    }
  }
  const settings = { ...settings_of_solve, ...given };
  if (typeof settings.solver !== "string") refuse(`solver: ${settings.solver} is not a name`);
  if (!(settings.tol >= 0)) refuse(`tol: ${settings.tol} is not a positive number`);
  const most = settings.max_iterations;
  if (most !== null && !(Number.isInteger(most) && most >= 1)) {
    refuse(`max_iterations: ${most} is not an integer of at least 1`);
  }
  const limit = settings.time_limit;
  if (limit !== null && !(limit > 0)) {
    refuse(`time_limit: ${limit} is not a positive number of seconds`);
  }
  if (settings.merit !== "both" && settings.merit !== "natural") {
    refuse(`merit: '${settings.merit}' is neither both nor natural`);
  }
  return {
    ...settings,
    max_iterations: most ?? 0,
    time_limit: limit ?? Infinity,
    history: Boolean(settings.history),
  };
}

export class Fclib {
  #core;

  constructor(core) {
    this.#core = core;
    /** The fields of problems, solutions and merits: name, type, sizes, unit and meaning. */
    this.structs = core.structs();
    this.version = this.structs.version;
  }

  #call(name, ...values) {
    const { value, error } = this.#core[name](...values);
    if (error) throw new FclibError(error.kind, error.message, error.where);
    return value;
  }

  /** All solvers, with their options: name, type, default, unit, doc, choices, lowest, highest. */
  solvers() {
    return this.#core.solvers();
  }

  /** The solvers that take a problem. */
  solvers_for(problem) {
    const dimensions = "mu_r" in problem ? "rolling_dimensions" : "dimensions";
    return this.solvers().filter((solver) => solver[dimensions].includes(problem.spacedim));
  }

  /** { formulation, n, m, p, nc } of a problem; throws at the first thing wrong with its data. */
  validate(problem) {
    return this.#call("validate", problem);
  }

  /** Throws where a solution does not fit the problem; `where` is its name in the message. */
  validate_solution(problem, solution, where = "/solution") {
    this.#call("validate_solution", problem, solution, where);
  }

  /**
   * Solves a problem. on_report({ iteration, error, time, stage, r }) is called where the solver
   * evaluates its error; where it returns false the solver stops. `r` is the iterate, copied when it
   * is asked for, and undefined where the solver has none at hand.
   */
  solve(problem, settings = {}, on_report = undefined) {
    const own = complete(settings);
    let failure;
    const report =
      on_report &&
      ((iteration, error, time, stage, address, size) => {
        const core = this.#core;
        try {
          const go_on = on_report({
            iteration,
            error,
            time,
            stage,
            get r() {
              return address ? core.numbers_at(address, size) : undefined;
            },
          });
          return go_on !== false;
        } catch (thrown) {
          failure = { thrown };
          return false;
        }
      });
    const result = this.#call("solve", problem, own, report);
    if (failure) throw failure.thrown;
    return result;
  }

  /** The merit of a solution: error, natural, scaled_natural, ... as in fclib.structs.merit. */
  merit(problem, solution) {
    return this.#call("merit", problem, solution);
  }

  /** What libfclib calls MERIT_1. */
  merit_1(problem, solution) {
    return this.#call("merit_1", problem, solution);
  }

  /** The merit contact by contact: status ("open", "stick", "slide"), u, natural, cone, dual_cone,
   * and mismatches of what is stored. */
  contact_merits(problem, solution) {
    return this.#call("contact_merits", problem, solution);
  }

  /** The local problem of a global one. */
  condense(problem) {
    return this.#call("condense", problem);
  }

  /** A local problem without its bilateral constraints. */
  eliminate(problem) {
    return this.#call("eliminate", problem);
  }

  /** The problem with all its matrices in one storage: csr, csc, triplet or dense. */
  with_storage(problem, storage) {
    return this.#call("with_storage", problem, storage);
  }

  /** The connected components: { count, contact, dof, bilateral }. */
  islands(problem) {
    return this.#call("islands", problem);
  }

  /** What y (and z) prove: { y, z, gain, distance, bound }, or null. A proof whose bound is Infinity
   * says that there is no solution, else that there is none of a smaller norm. */
  check_certificate(problem, y, z = undefined) {
    return this.#call("check_certificate", problem, y, z);
  }

  /** A proof near y that the problem has no solution, or null. */
  prove_no_solution(problem, y) {
    return this.#call("prove_no_solution", problem, y);
  }

  /**
   * What a file holds: { problem, solution, guesses, contacts, bodies }, null where there is none. The
   * bytes are those of an FCLIB file of any version, or of a text of Siconos; `kind` is of the problem
   * where there are several.
   */
  async read(bytes, kind = "") {
    const content = bytes instanceof Uint8Array ? bytes : new Uint8Array(bytes);
    const { is_hdf5, read_hdf5 } = await import("./fclib-hdf5.js");
    const binary = content.subarray(0, 4096).some((byte) => byte === 0 || byte === 0x89);
    if (binary || is_hdf5(content)) return read_hdf5(this, content, kind);
    const problem = this.read_siconos(new TextDecoder().decode(content), kind);
    return { problem, solution: null, guesses: [], contacts: null, bodies: null };
  }

  /** The problem in a text of Siconos; `kind` where its sizes should not decide. */
  read_siconos(text, kind = "") {
    return this.#call("read_siconos", text, kind);
  }
}

async function bytes_of(url) {
  if (url.protocol === "file:") {
    const { readFile } = await import("node:fs/promises");
    return readFile(url);
  }
  const answer = await fetch(url);
  if (!answer.ok) throw new FclibError("file", `${url}: ${answer.status} ${answer.statusText}`);
  return answer.arrayBuffer();
}

/** Loads the core, once; `wasm` are the bytes of fclib-core.wasm, from beside this file otherwise. */
export async function load({ wasm = undefined } = {}) {
  const { default: createCore } = await import("./fclib-core.mjs");
  const wasmBinary = wasm ?? (await bytes_of(new URL("./fclib-core.wasm", import.meta.url)));
  return new Fclib(await createCore({ wasmBinary }));
}
