// FCLIB files in a browser or in Node: all that core/io/hdf5/read.cpp reads, with its messages. What
// the data must satisfy the core says (validate). HDF5 is that of h5wasm, of which a page loads
// four megabytes when it reads its first file.

import { FclibError } from "./fclib.js";

const fail = (where, message) => {
  throw new FclibError("file", where ? `${where}: ${message}` : message, where);
};

// classes of types in HDF5
const INTEGER = 0;
const FLOAT = 1;
const STRING = 3;

const layout = "FCLIB geometry 1"; // the mark of our groups of geometry
const largest = 2 ** 31 - 1;
const longest = 2n ** 63n - 1n;
const best_compression = 1100; // deflate cannot shrink data further than this
const small_dataset = 2 ** 20;
const filters_read = new Set([1, 2, 3]); // deflate, shuffle and Fletcher's checksum
const filters_not_read = new Set([5, 6]); // n-bit and scale-offset trust what they read

/** A group of a file, and where it is. */
class Group {
  constructor(library, file, group, path) {
    Object.assign(this, { library, file, group, path });
  }

  child(name) {
    return (this.path === "/" ? "/" : `${this.path}/`) + name;
  }

  /** What has a name, or null. */
  get(name) {
    let names;
    try {
      names = this.group.keys();
    } catch {
      fail(this.child(name), "cannot be looked up by HDF5 (the file is damaged)");
    }
    if (!names.includes(name)) return null;
    const { Group: Groups, Dataset, Datatype } = this.library;
    try {
      const found = this.group.get(name);
      if (found instanceof Groups) found.keys();
      return [Groups, Dataset, Datatype].some((type) => found instanceof type) ? found : null;
    } catch {
      return null; // a link to nothing
    }
  }

  has(name) {
    return this.get(name) !== null;
  }

  open(name) {
    const found = this.get(name);
    if (!(found instanceof this.library.Group)) {
      fail(this.child(name), found ? "is not a group" : "the group is missing");
    }
    return new Group(this.library, this.file, found, this.child(name));
  }

  dataset(name, missing = "the dataset is missing") {
    const found = this.get(name);
    if (!(found instanceof this.library.Dataset)) {
      fail(this.child(name), found ? "is not a dataset that HDF5 can open" : missing);
    }
    return found;
  }

  /** The values of a dataset of numbers, looked at before memory is asked for. */
  numbers(name, integers) {
    const path = this.child(name);
    const dataset = this.dataset(name);
    let metadata;
    try {
      metadata = dataset.metadata;
    } catch {
      fail(path, "has no properties that HDF5 can read");
    }
    if (integers && metadata.type !== INTEGER) fail(path, "does not hold integers");
    if (metadata.type !== INTEGER && metadata.type !== FLOAT) fail(path, "does not hold numbers");
    const shape = metadata.shape ?? [0];
    if (shape.length > 1) fail(path, "has more than one dimension");
    if (metadata.virtual_sources) fail(path, "keeps its data in other places, which are not read");
    const size = shape.reduce((product, extent) => product * extent, 1);
    const bytes = size * metadata.size;
    if (bytes > small_dataset && bytes > best_compression * this.file.size) {
      fail(path, `declares ${size} entries, but the file does not hold them`);
    }
    const chunk = (metadata.chunks ?? []).reduce((product, extent) => product * extent, 1);
    if (
      metadata.chunks &&
      (chunk < 1 ||
        size / chunk > Math.max(1024, this.file.size) ||
        chunk * metadata.size > Math.max(2 ** 26, best_compression * this.file.size))
    ) {
      fail(path, "has chunks that the file does not hold");
    }
    if (size > largest) fail(path, `has ${size} entries, more than can be numbered`);
    let values;
    try {
      if (dataset.filters.some(({ id }) => filters_not_read.has(id))) {
        fail(path, "is packed by a filter that is not read (n-bit or scale-offset)");
      }
      const other = dataset.filters.find(({ id }) => !filters_read.has(id));
      if (other && size > 0) {
        const { id, name } = other;
        fail(path, `is packed by a filter that is not installed (${name}, number ${id})`);
      }
      values = size === 0 ? [] : dataset.value;
    } catch (error) {
      if (error instanceof FclibError) throw error;
    }
    if (values === null || values === undefined) {
      fail(path, "cannot be read (the file is damaged or cut short)");
    }
    if (!ArrayBuffer.isView(values) && !Array.isArray(values)) values = [values];
    if (!integers) return values instanceof Float64Array ? values : Float64Array.from(values, Number);
    if (values instanceof Int32Array) return values;
    return Int32Array.from(values, (value, k) => {
      if (value < -largest - 1 || value > largest) {
        const wide = BigInt(value) > longest ? longest : value; // as HDF5 clips it
        fail(`${path}[${k}]`, `${wide} does not fit a 32-bit integer`);
      }
      return Number(value);
    });
  }

  number(name, integer) {
    const values = this.numbers(name, integer);
    if (values.length !== 1) {
      fail(this.child(name), `has ${values.length} entries, expected one`);
    }
    return values[0];
  }

  text(name) {
    const path = this.child(name);
    const { metadata } = this.dataset(name, "is not a dataset that HDF5 can open");
    if (metadata.type !== STRING) fail(path, "does not hold text");
    const size = (metadata.shape ?? [0]).reduce((product, extent) => product * extent, 1);
    if (size !== 1) fail(path, "does not hold one text");
    if (!metadata.vlen && metadata.size > small_dataset && metadata.size > this.file.size) {
      fail(path, `declares a text of ${metadata.size} bytes that the file does not hold`);
    }
    let value;
    try {
      value = this.get(name).value;
    } catch {
      fail(path, "cannot be read");
    }
    if (Array.isArray(value)) [value] = value;
    if (typeof value !== "string") fail(path, "cannot be read");
    return value.split("\0", 1)[0];
  }

  text_if_there(name) {
    return this.has(name) ? this.text(name) : "";
  }
}

function shortened(values, length, where) {
  if (values.length < length) {
    fail(where, `has ${values.length} entries, expected ${length}`);
  }
  return values.length > length ? values.slice(0, length) : values;
}

function read_matrix_info(group) {
  const known = ["conditioning", "determinant", "rank"].filter((name) => group.has(name));
  if (known.length === 0 && !group.has("comment")) return undefined;
  const info = { comment: group.text_if_there("comment"), conditioning: 0, determinant: 0, rank: 0 };
  for (const name of known) info[name] = group.number(name, name === "rank");
  return info;
}

function read_matrix(parent, name) {
  const group = parent.open(name);
  const rows = group.number("m", true);
  const cols = group.number("n", true);
  if (rows < 0) fail(group.child("m"), "is negative");
  if (cols < 0) fail(group.child("n"), "is negative");
  const nz = group.number("nz", true);
  const matrix = { storage: "dense", rows, cols };
  if (nz === -3) {
    matrix.x = group.numbers("x", false);
  } else if (nz >= -2) {
    const p = group.numbers("p", true);
    const i = group.numbers("i", true);
    const x = group.numbers("x", false);
    let entries = nz;
    if (nz >= 0) {
      matrix.storage = "triplet";
      matrix.p = shortened(p, nz, group.child("p"));
    } else {
      matrix.storage = nz === -1 ? "csc" : "csr";
      matrix.p = p;
      entries = p.length > 0 ? p[p.length - 1] : -1;
      if (entries < 0) fail(group.child("p"), "has no valid last pointer");
    }
    // nzmax may leave room at the end
    matrix.i = shortened(i, entries, group.child("i"));
    matrix.x = shortened(x, entries, group.child("x"));
  } else {
    fail(
      group.child("nz"),
      `${nz} is no storage: expected the number of triplets, -1 (CSC), -2 (CSR) or -3 (dense)`,
    );
  }
  const info = read_matrix_info(group);
  return info ? { ...matrix, info } : matrix;
}

/** /contacts or /bodies, where the group is ours; undefined elsewhere. */
function read_table(root, name) {
  if (!(root.get(name) instanceof root.library.Group)) return undefined;
  const group = root.open(name);
  const mark = group.group.attrs.layout;
  const { type, vlen, size } = mark?.metadata ?? {};
  if (type !== STRING || vlen || size !== layout.length + 1 || mark.value !== layout) {
    return undefined;
  }
  const table = {};
  for (const key of group.group.keys()) {
    const { type: kind } = group.dataset(key, "is not a dataset that HDF5 can open").metadata;
    if (kind === INTEGER || kind === FLOAT) table[key] = group.numbers(key, kind === INTEGER);
    if (kind === STRING) table[key] = group.text(key);
  }
  return table;
}

function read_problem(structs, root, kind) {
  const group = root.open(`fclib_${kind}`);
  const vectors = group.open("vectors");
  const problem = { kind };
  for (const { name, type, required } of structs.problems[kind].fields) {
    const place = type === "vector" ? vectors : group;
    if (!required && !place.has(name)) continue;
    if (type === "matrix") problem[name] = read_matrix(place, name);
    if (type === "vector") problem[name] = place.numbers(name, false);
    if (type === "number") problem[name] = place.number(name, true);
  }
  const words = group.has("info") ? group.open("info") : null;
  problem.info = Object.fromEntries(
    structs.info.map(({ name }) => [name, words?.text_if_there(name) ?? ""]),
  );
  for (const name of ["contacts", "bodies"]) {
    const table = read_table(root, name);
    if (table) problem[name] = table;
  }
  return problem;
}

function read_solution(structs, parent, name) {
  const group = parent.open(name);
  const solution = {};
  for (const { name: member, required } of structs.solution) {
    if (required || group.has(member)) solution[member] = group.numbers(member, false);
  }
  return solution;
}

function kind_to_read(structs, root, asked) {
  const kinds = Object.keys(structs.problems).filter((kind) => root.has(`fclib_${kind}`));
  if (kinds.includes(asked)) return asked;
  const known = kinds.join(", ");
  if (asked) fail("/", `holds no ${asked} problem${known ? `; it holds: ${known}` : ""}`);
  if (kinds.length === 0) fail("/", "holds no problem in a known FCLIB layout");
  if (kinds.length > 1) fail("/", `holds several problems, name one of: ${known}`);
  return kinds[0];
}

const signature = [0x89, 0x48, 0x44, 0x46, 0x0d, 0x0a, 0x1a, 0x0a];

/** Whether HDF5 would take the bytes for a file of its own. */
export function is_hdf5(bytes) {
  for (let at = 0; at + signature.length <= bytes.length; at = at === 0 ? 512 : 2 * at) {
    if (signature.every((byte, k) => bytes[at + k] === byte)) return true;
  }
  return false;
}

/** HDF5 tells a console of each error, which is thrown here. */
function silence(files) {
  const stderr = files.streams[2];
  stderr.stream_ops = { ...stderr.stream_ops, write: (stream, buffer, offset, length) => length };
}

let checked = null;

/** Lets reads throw that HDF5 could not do: h5wasm gives what memory held before. */
function check_reads(module) {
  if (module === checked) return;
  checked = module;
  const read = module.get_dataset_data;
  module.get_dataset_data = (...where) => {
    if (read(...where) < 0) throw new Error("HDF5 could not read a dataset");
  };
}

let count = 0;

/** What an FCLIB file holds: { problem, solution, guesses, contacts, bodies }. */
export async function read_hdf5(fclib, bytes, kind = "") {
  if (!is_hdf5(bytes)) fail("", "is not an HDF5 file");
  const library = await import("./hdf5_hl.js");
  const module = await library.ready;
  const { FS } = module;
  silence(FS);
  check_reads(module);
  const name = `fclib-${count++}.hdf5`;
  FS.writeFile(name, bytes);
  let file;
  try {
    try {
      file = new library.File(name, "r");
    } catch {
      file = null;
    }
    if (!file || !(file.file_id > 0n)) {
      fail("", "cannot be opened by HDF5 (the file is damaged or cut short)");
    }
    const { structs } = fclib;
    const root = new Group(library, { size: bytes.length }, file, "/");
    const problem = read_problem(structs, root, kind_to_read(structs, root, kind));
    fclib.validate(problem);
    let solution = null;
    // of several problems these are the first one's, which is the global one
    const own = problem.kind === Object.keys(structs.problems).find((one) => root.has(`fclib_${one}`));
    if (own && root.has("solution")) solution = read_solution(structs, root, "solution");
    const guesses = [];
    if (own && root.has("guesses")) {
      const group = root.open("guesses");
      const number = group.number("number_of_guesses", true);
      if (number < 0) fail(group.child("number_of_guesses"), "is negative");
      for (let k = 1; k <= number; ++k) guesses.push(read_solution(structs, group, String(k)));
    }
    const { contacts = null, bodies = null } = problem;
    return { problem, solution, guesses, contacts, bodies };
  } finally {
    try {
      file?.close();
    } finally {
      FS.unlink(name);
    }
  }
}
