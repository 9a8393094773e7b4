// FCLIB in a browser or in Node: problems, merits and solvers of frictional contact.
//
//   import { load } from "./fclib.js";
//   const fclib = await load();
//   const result = fclib.solve(problem, { solver: "auto", tol: 1e-8 });
//
// Names are those of Python (docs/browser.md, fclib.d.ts). Problems are plain objects whose vectors
// are Float64Array and whose matrices are { storage, rows, cols, p, i, x }. Calls do not return
// before they are done: for a page that stays alive there is fclib-worker.js.

/** An error of the core. `kind`: file, problem, option, unsuitable, memory or internal. */
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
  if (!(settings.tol >= 0 && settings.tol < Infinity)) {
    refuse(`tol: ${settings.tol} is not a finite number of 0 or more`);
  }
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

const largest = 2 ** 31 - 1;

const wrong = (where, message) => {
  throw new FclibError("problem", `${where}: ${message}`, where);
};

const is_missing = (value) => value === undefined || value === null;

const is_array = (value) =>
  Array.isArray(value) || (ArrayBuffer.isView(value) && value.length !== undefined);

/** A part of an array. slice() would take a microsecond even for a small part. */
function copy(numbers, first, size) {
  if (size > 64) return numbers.slice(first, first + size);
  const result = new Float64Array(size);
  for (let k = 0; k < size; ++k) result[k] = numbers[first + k];
  return result;
}

/** The arguments of a call in the memory of the core: first the arrays, then integers that describe
 * them, in the order of browser/convert.hpp. */
class Block {
  #core;
  #structs;
  #arrays = [];
  #bytes = 0;
  #words = [0];

  constructor(core, structs) {
    this.#core = core;
    this.#structs = structs;
  }

  #array(values, where, integers) {
    if (!is_array(values)) wrong(where, "is not an array of numbers");
    if (integers && !(values instanceof Int32Array)) {
      for (const value of values) this.#check(value, where);
    }
    this.#words.push(this.#bytes, values.length);
    if (values.length === 0) return;
    this.#arrays.push(this.#bytes, values, integers);
    this.#bytes += 8 * (integers ? (values.length + 1) >> 1 : values.length);
  }

  #check(value, where) {
    if (!Number.isInteger(value) || Math.abs(value) > largest) {
      wrong(where, "is not an integer of 32 bits");
    }
    return value;
  }

  #matrix(a, where) {
    if (typeof a !== "object") wrong(where, "is not a matrix { storage, rows, cols, p, i, x }");
    if (is_missing(a.storage)) wrong(`${where}.storage`, "is missing");
    if (typeof a.storage !== "string") wrong(`${where}.storage`, "is not a text");
    const { value: storage, error } = this.#storage(a.storage);
    if (error) throw new FclibError(error.kind, error.message, error.where);
    const rows = this.#check(a.rows, `${where}.rows`);
    this.#words.push(1, storage, rows, this.#check(a.cols, `${where}.cols`));
    const sparse = a.storage !== "dense";
    this.#array(sparse ? a.p : [], `${where}.p`, true);
    this.#array(sparse ? a.i : [], `${where}.i`, true);
    this.#array(a.x, `${where}.x`, false);
  }

  #storage(name) {
    const known = this.#structs.storages.indexOf(name);
    return known >= 0 ? { value: known } : this.#core.storage_of(name);
  }

  #fields(fields, object) {
    for (const { name, type, required } of fields) {
      const value = object[name];
      const missing = is_missing(value);
      if (type === "number") {
        if (missing) this.#words.push(0);
        else this.#words.push(1, this.#check(value, name));
      } else if (missing && required) {
        wrong(name, "is missing");
      } else if (type === "vector") {
        this.vector(value, name);
      } else if (missing) {
        this.#words.push(0);
      } else {
        this.#matrix(value, name);
      }
    }
  }

  problem(problem) {
    if (typeof problem !== "object" || problem === null) wrong("problem", "is not an object");
    const { problems } = this.#structs;
    const kinds = Object.keys(problems);
    const kind = kinds.indexOf(problem.kind);
    if (kind < 0) {
      const given = typeof problem.kind === "string" ? problem.kind : "";
      wrong("kind", `is '${given}', but must be one of: ${kinds.join(", ")}`);
    }
    this.#words.push(kind);
    this.#fields(problems[problem.kind].fields, problem);
    return this;
  }

  solution(solution) {
    if (typeof solution !== "object" || solution === null) wrong("solution", "is not an object");
    this.#fields(this.#structs.solution, solution);
    return this;
  }

  /** An array; one that is missing is empty. */
  vector(values, where) {
    if (is_missing(values)) this.#words.push(0, 0);
    else this.#array(values, where, false);
    return this;
  }

  /** Its address in the core, until the next call. */
  place() {
    const core = this.#core;
    const words = this.#words;
    const start = core.reserve(this.#bytes + 4 * words.length);
    if (start === 0) {
      throw new FclibError("memory", "the problem does not fit into the memory of this page");
    }
    const arrays = this.#arrays;
    for (let k = 0; k < arrays.length; k += 3) {
      const at = start + arrays[k];
      if (arrays[k + 2]) core.HEAP32.set(arrays[k + 1], at >> 2);
      else core.HEAPF64.set(arrays[k + 1], at >> 3);
    }
    words[0] = this.#bytes;
    core.HEAP32.set(words, (start + this.#bytes) >> 2);
    return start + this.#bytes;
  }
}

export class Fclib {
  #core;
  #stages = [];

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

  #block(problem) {
    return new Block(this.#core, this.structs).problem(problem);
  }

  /** All solvers, with their options: name, type, default, unit, doc, choices, lowest, highest. */
  solvers() {
    return this.#core.solvers();
  }

  /** The solvers that take a problem. */
  solvers_for(problem) {
    const dimensions =
      "mu_s" in problem
        ? "spin_dimensions"
        : "mu_r" in problem
          ? "rolling_dimensions"
          : "dimensions";
    return this.solvers().filter((solver) => solver[dimensions].includes(problem.spacedim));
  }

  /** { formulation, n, m, p, nc } of a problem. Throws at the first fault of its data. */
  validate(problem) {
    return this.#call("validate", this.#block(problem).place());
  }

  /** Throws if a solution does not fit the problem; `where` is its name in the message. */
  validate_solution(problem, solution, where = "/solution") {
    this.#call("validate_solution", this.#block(problem).solution(solution).place(), where);
  }

  /**
   * Solves a problem. Each time the solver evaluates its error, it calls
   * on_report({ iteration, error, time, stage, r }). If this returns false, the solver stops. `r`
   * is the iterate. It is copied when it is read, and undefined if the solver has no iterate to
   * show.
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
    const { guess } = own;
    if (!is_missing(guess) && is_missing(guess.r)) wrong("r", "is missing");
    const given = own.options ?? {};
    const core = this.#core;
    const at = core.solve(
      this.#block(problem).vector(guess?.r, "r").place(),
      own.solver,
      own.tol,
      own.merit === "natural",
      own.max_iterations,
      own.time_limit,
      own.history,
      Object.keys(given).length > 0 ? given : undefined,
      own.clock ?? undefined,
      report,
    );
    if (failure) throw failure.thrown;
    if (at === 0) {
      const { error } = core.failure();
      throw new FclibError(error.kind, error.message, error.where);
    }
    return this.#result(own, at >> 3);
  }

  /** The last result; its numbers are those of to_numbers of browser/module.cpp. */
  #result(own, at) {
    const core = this.#core;
    const numbers = core.HEAPF64;
    const status = this.structs.statuses[numbers[at]];
    const proven = numbers[at + 5] === 1;
    const result = {
      solver: own.solver,
      status,
      converged: status === "converged",
      iterations: numbers[at + 1],
      error: numbers[at + 2],
      cpu_s: numbers[at + 3],
      setup_s: numbers[at + 4],
      solution: {},
      certificate: null,
      stages: [],
    };
    let next = at + 6;
    for (const { name, required } of this.structs.solution) {
      const size = numbers[next + 1];
      if (required || size > 0) result.solution[name] = copy(numbers, numbers[next] >> 3, size);
      next += 2;
    }
    const kinds = [];
    for (let k = numbers[next++]; k > 0; --k, next += 6) {
      kinds.push(numbers[next]);
      result.stages.push({
        name: "",
        families: "",
        calls: numbers[next + 1],
        solved: numbers[next + 2],
        iterations: numbers[next + 3],
        factorisations: numbers[next + 4],
        time: numbers[next + 5],
      });
    }
    // from here on the core may move its memory
    kinds.forEach((kind, k) => {
      Object.assign(result.stages[k], (this.#stages[kind] ??= core.stage(kind)));
    });
    if (proven) result.certificate = core.certificate();
    if (own.history) result.history = core.history();
    return result;
  }

  /** The merit of a solution: error, natural, scaled_natural, ... as in fclib.structs.merit. */
  merit(problem, solution) {
    return this.#call("merit", this.#block(problem).solution(solution).place());
  }

  /** The merit that libfclib calls MERIT_1. */
  merit_1(problem, solution) {
    return this.#call("merit_1", this.#block(problem).solution(solution).place());
  }

  /** The merit contact by contact: status ("open", "stick", "slide"), u, natural, cone, dual_cone,
   * and mismatches of what is stored. */
  contact_merits(problem, solution) {
    return this.#call("contact_merits", this.#block(problem).solution(solution).place());
  }

  /** The local problem of a global one. */
  condense(problem) {
    return this.#call("condense", this.#block(problem).place(), problem);
  }

  /** A local problem without its bilateral constraints. */
  eliminate(problem) {
    return this.#call("eliminate", this.#block(problem).place(), problem);
  }

  /** The problem with all its matrices in one storage: csr, csc, triplet or dense. */
  with_storage(problem, storage) {
    return this.#call("with_storage", this.#block(problem).place(), problem, storage);
  }

  /** The connected components: { count, contact, dof, bilateral }. */
  islands(problem) {
    return this.#call("islands", this.#block(problem).place());
  }

  /** The proof that y (and z) are: { y, z, gain, distance, bound }, or null if they prove nothing.
      If * the bound is Infinity, there is no solution. Else no solution has a norm below the bound.
      */
  check_certificate(problem, y, z = undefined) {
    return this.#call(
      "check_certificate",
      this.#block(problem).vector(y, "y").vector(z, "z").place(),
    );
  }

  /** A proof near y that the problem has no solution, or null. */
  prove_no_solution(problem, y) {
    return this.#call("prove_no_solution", this.#block(problem).vector(y, "y").place());
  }

  /**
   * The content of a file: { problem, solution, guesses, contacts, bodies, left_out }. What the
   * file lacks is null. The bytes are those of an FCLIB file of any version, or of a text of
   * Siconos. If the file has several problems, `kind` says which one. `left_out` names what could
   * not be read.
   */
  async read(bytes, kind = "") {
    const content = bytes instanceof Uint8Array ? bytes : new Uint8Array(bytes);
    const { is_hdf5, read_hdf5 } = await import("./fclib-hdf5.js");
    const binary = content.subarray(0, 4096).some((byte) => byte === 0 || byte === 0x89);
    if (binary || is_hdf5(content)) return read_hdf5(this, content, kind);
    const text = new TextDecoder().decode(content);
    if (text.startsWith("version https://git-lfs.github.com/spec/")) {
      throw new FclibError(
        "file",
        "is a pointer of Git LFS, not the file itself: run 'git lfs pull'",
      );
    }
    const problem = this.read_siconos(text, kind);
    return { problem, solution: null, guesses: [], contacts: null, bodies: null, left_out: [] };
  }

  /** The problem in a text of Siconos. If `kind` is given, the sizes do not decide the kind. */
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

/** Loads the core, once. `wasm` has the bytes of fclib-core.wasm; without it the file is read. */
export async function load({ wasm = undefined } = {}) {
  const { default: createCore } = await import("./fclib-core.mjs");
  const wasmBinary = wasm ?? (await bytes_of(new URL("./fclib-core.wasm", import.meta.url)));
  return new Fclib(await createCore({ wasmBinary }));
}
