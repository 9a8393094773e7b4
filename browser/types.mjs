// Writes fclib.d.ts and fclib-worker.d.ts into the folder of a built module: the types of its
// objects by the core's own lists of fields, solvers and options.
//
//   node types.mjs FOLDER

import { writeFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const folder = resolve(process.argv[2]);
const { load } = await import(pathToFileURL(join(folder, "fclib.js")));
const fclib = await load();
const { structs } = fclib;

const type_names = { matrix: "Matrix", vector: "Float64Array", text: "string", number: "number" };

function shape({ type, rows, cols, unit }) {
  const sizes = [rows, cols].filter((size, place) => size !== "1" || (place === 0 && cols !== "1"));
  const facts = type === "vector" || type === "matrix" ? [`(${sizes.join(", ")})`] : [];
  if (unit && unit !== "1") facts.push(`[${unit}]`);
  return facts.map((fact) => `${fact} `).join("");
}

function members(fields, optional = (field) => !field.required) {
  return fields
    .map(
      (field) =>
        `  /** ${shape(field)}${field.doc} */\n` +
        `  ${field.name}${optional(field) ? "?" : ""}: ${type_names[field.type]};\n`,
    )
    .join("");
}

const name_of = (kind) =>
  kind
    .split("_")
    .map((word) => word[0].toUpperCase() + word.slice(1))
    .join("") + "Problem";

const kinds = Object.keys(structs.problems);
const problems = kinds.map((kind) => {
  const { doc, dimensions, fields } = structs.problems[kind];
  return (
    `/** ${doc} spacedim is ${[...dimensions].join(" or ")}. */\n` +
    `export interface ${name_of(kind)} {\n  kind: "${kind}";\n` +
    members(fields) +
    "  info?: Partial<ProblemInfo>;\n  contacts?: Table;\n  bodies?: Table;\n}\n"
  );
});

const solver_names = fclib.solvers().map(({ name }) => `"${name}"`);
const option_type = ({ type, choices }) =>
  type === "bool"
    ? "boolean"
    : type === "choice"
      ? choices.map((choice) => `"${choice}"`).join(" | ")
      : type === "text"
        ? "string"
        : "number";
const option_types = new Map();
for (const { options } of fclib.solvers()) {
  for (const option of options) {
    const types = option_types.get(option.name) ?? new Set();
    types.add(option_type(option));
    option_types.set(option.name, types);
  }
}
const options = [...option_types]
  .sort(([a], [b]) => (a < b ? -1 : 1))
  .map(([name, types]) => `  ${name}?: ${[...types].join(" | ")};\n`)
  .join("");

const source = "Made by browser/types.mjs from the core's lists of fields and options.";
const common = `// fclib ${structs.version}. ${source}

/** A matrix: triplet (i rows, p columns), csc (p column pointers), csr (p row pointers), or dense
 * (x by columns, without p and i). */
export interface Matrix {
  storage: "csr" | "csc" | "triplet" | "dense";
  rows: number;
  cols: number;
  p?: Int32Array;
  i?: Int32Array;
  x: Float64Array;
  info?: MatrixInfo;
}

export interface MatrixInfo {
${members(structs.matrix_info)}}

export interface ProblemInfo {
${members(structs.info)}}

/** Columns by their names, as docs/format.md has them for /contacts and /bodies. */
export type Table = Record<string, Int32Array | Float64Array | string>;

${problems.join("\n")}
export type Problem = ${kinds.map(name_of).join(" | ")};

export interface Solution {
${members(structs.solution, (field) => field.name !== "r")}}

export interface Merit {
${members(structs.merit, () => false)}}

export interface ContactMerits {
  status: ("open" | "stick" | "slide")[];
  /** (m) [m/s] velocity, recomputed */
  u: Float64Array;
  /** (nc) ||r - P_K(r - u^)||, not relative to anything */
  natural: Float64Array;
  /** (nc) [N s] distance of r from K */
  cone: Float64Array;
  /** (nc) [m/s] distance of u^ from K* */
  dual_cone: Float64Array;
  mismatches: { part: string; index: number; stored: number; difference: number; error: number }[];
}

/** Why a problem has no solution; of a norm of at least \`bound\` there may be one. */
export interface Certificate {
  y: Float64Array;
  z?: Float64Array;
  gain: number;
  distance: number;
  bound: number;
}

export interface OptionInfo {
  name: string;
  type: "bool" | "int" | "float" | "choice" | "text";
  default: boolean | number | string;
  unit: string;
  doc: string;
  choices: string[];
  lowest: number;
  highest: number;
}

export type SolverName = ${solver_names.join(" | ")};

export interface SolverInfo {
  name: SolverName;
  family: string;
  title: string;
  citation: string;
  dimensions: number[];
  rolling_dimensions: number[];
  spin_dimensions: number[];
  max_iterations: number;
  options: OptionInfo[];
}

/** The options of all solvers; each solver takes its own. */
export interface Options {
${options}}

export interface Settings {
  /** if it is not given: "auto" */
  solver?: SolverName;
  /** bound on Merit.error; 1e-8 */
  tol?: number;
  /** null: the solver's own limit */
  max_iterations?: number | null;
  /** [s] of the wall clock, conversions included */
  time_limit?: number | null;
  /** only its r is used */
  guess?: Solution | null;
  merit?: "both" | "natural";
  history?: boolean;
  /** [s] another clock, for tests */
  clock?: (() => number) | null;
  options?: Options;
}

export interface Report {
  iteration: number;
  error: number;
  /** [s] since the solver started */
  time: number;
  stage: string;
  /** the iterate, if the solver can show it */
  readonly r: Float64Array | undefined;
}

export interface Stage {
  name: string;
  families: string;
  calls: number;
  solved: number;
  iterations: number;
  factorisations: number;
  time: number;
}

export interface Result {
  solver: string;
  status:
    | "converged"
    | "iteration_limit"
    | "time_limit"
    | "diverged"
    | "inaccurate"
    | "stalled"
    | "interrupted"
    | "infeasible";
  converged: boolean;
  iterations: number;
  error: number;
  /** [s] of the solver alone, by the wall clock */
  cpu_s?: number;
  /** [s] of conversions, validation and merit */
  setup_s?: number;
  solution: Solution;
  certificate: Certificate | null;
  stages: Stage[];
  history?: Omit<Report, "r">[];
}

export interface Sizes {
  formulation: string;
  n: number;
  m: number;
  p: number;
  nc: number;
}

export interface Islands {
  count: number;
  contact: Int32Array;
  dof: Int32Array;
  bilateral: Int32Array;
}

/** What a file holds. */
export interface Contents {
  problem: Problem;
  solution: Solution | null;
  guesses: Solution[];
  contacts: Table | null;
  bodies: Table | null;
  /** A line for each thing that could not be read, and that the problem can do without. */
  left_out: string[];
}

export interface FieldInfo {
  name: string;
  type: "matrix" | "vector" | "text" | "number";
  rows: string;
  cols: string;
  required: boolean;
  unit: string;
  doc: string;
}

export interface Structs {
  version: string;
  problems: Record<Problem["kind"], { doc: string; dimensions: Int32Array; fields: FieldInfo[] }>;
  solution: FieldInfo[];
  merit: FieldInfo[];
  info: FieldInfo[];
  matrix_info: FieldInfo[];
  statuses: string[];
  storages: string[];
}

export declare class FclibError extends Error {
  constructor(kind: string, message: string, where?: string);
  kind: "file" | "problem" | "option" | "unsuitable" | "memory" | "internal";
  where: string;
}
`;

// each function once: the worker has them as promises
const functions = [
  ["solvers", "", "SolverInfo[]"],
  ["solvers_for", "problem: Problem", "SolverInfo[]"],
  ["validate", "problem: Problem", "Sizes"],
  ["validate_solution", "problem: Problem, solution: Solution, where?: string", "void"],
  ["merit", "problem: Problem, solution: Solution", "Merit"],
  ["merit_1", "problem: Problem, solution: Solution", "number"],
  ["contact_merits", "problem: Problem, solution: Solution", "ContactMerits"],
  ["condense", "problem: Problem", "Problem"],
  ["eliminate", "problem: Problem", "Problem"],
  ["with_storage", 'problem: Problem, storage: Matrix["storage"]', "Problem"],
  ["islands", "problem: Problem", "Islands"],
  [
    "check_certificate",
    "problem: Problem, y: Float64Array, z?: Float64Array",
    "Certificate | null",
  ],
  ["prove_no_solution", "problem: Problem, y: Float64Array", "Certificate | null"],
  ["read", 'bytes: ArrayBuffer | Uint8Array, kind?: Problem["kind"]', "Promise<Contents>"],
  ["read_siconos", 'text: string, kind?: Problem["kind"]', "Problem"],
];
const known = Object.getOwnPropertyNames(Object.getPrototypeOf(fclib));
for (const name of known.filter((one) => one !== "constructor" && one !== "solve")) {
  if (!functions.some(([own]) => own === name)) throw new Error(`types.mjs: no type of ${name}`);
}
const declared = (wrap) =>
  functions.map(([name, given, result]) => `  ${name}(${given}): ${wrap(result)};\n`).join("");

const main = `${common}
export declare class Fclib {
  readonly version: string;
  readonly structs: Structs;
${declared((result) => result)}  solve(
    problem: Problem,
    settings?: Settings,
    on_report?: (report: Report) => boolean | void,
  ): Result;
}

export declare function load(from?: { wasm?: ArrayBuffer | Uint8Array }): Promise<Fclib>;
`;

const worker = `// fclib ${structs.version}. Made by browser/types.mjs.

import type {
  Certificate,
  ContactMerits,
  Contents,
  Islands,
  Matrix,
  Merit,
  Problem,
  Report,
  Result,
  Settings,
  Sizes,
  Solution,
  SolverInfo,
} from "./fclib.js";

/** The reports of some 30 ms: the last, and [iteration, error, time] of all. */
export interface Reports extends Report {
  points: [number, number, number][];
}

/** A result to come. stop() resolves it with the last iterate that was reported. */
export interface Run extends Promise<Result> {
  stop(): void;
}

export declare class FclibWorker {
${declared((result) =>
  result.startsWith("Promise<") ? result : `Promise<${result}>`,
)}  solve(problem: Problem, settings?: Settings, on_report?: (reports: Reports) => void): Run;
  close(): void;
}
`;

writeFileSync(join(folder, "fclib.d.ts"), main);
writeFileSync(join(folder, "fclib-worker.d.ts"), worker);
