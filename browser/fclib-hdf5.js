// FCLIB files in a browser or in Node: it reads what core/io/hdf5/read.cpp reads, with the same
// messages. The core itself checks the data (validate). HDF5 comes from h5wasm; a page loads its
// four megabytes when it reads the first file.

import { FclibError } from "./fclib.js";
import { LayoutFile } from "./fclib-layout.js";

const fail = (where, message, kind = "file") => {
  throw new FclibError(kind, where ? `${where}: ${message}` : message, where);
};

// classes of types in HDF5
const INTEGER = 0;
const FLOAT = 1;
const STRING = 3;
const ENUM = 8;

const layout = "FCLIB geometry 1"; // the mark of our groups of geometry
const packed_mark = "symmetric_packed"; // of a matrix of which a file has one triangle
const largest = 2 ** 31 - 1;
const longest = 2n ** 63n - 1n;
const best_compression = 1100; // deflate cannot shrink data further than this
const small_dataset = 2 ** 20;
const longest_quoted = 40; // as long as the name of a file or of a dataset
const filters_read = new Set([1, 2, 3]); // deflate, shuffle and Fletcher's checksum
const filters_not_read = new Set([5, 6]); // n-bit and scale-offset trust what they read
const widths_read = { [INTEGER]: [1, 2, 4, 8], [FLOAT]: [4, 8] }; // that h5wasm makes arrays of

const product = (extents) => extents.reduce((all, extent) => all * extent, 1);
const is_flat = (shape) => shape.filter((extent) => extent !== 1).length <= 1;

/** A text of a file, for a message: short, and without characters that control a terminal. */
function quoted(text) {
  const bytes = [...new TextEncoder().encode(text)];
  const shown = bytes
    .slice(0, longest_quoted)
    .map((byte) => (byte >= 32 && byte <= 126 ? String.fromCharCode(byte) : "?"));
  return `'${shown.join("")}${bytes.length > longest_quoted ? "...'" : "'"}`;
}

/** A number in as few characters as it has, as the core writes it. */
function shortest(value) {
  if (Number.isNaN(value)) return "nan";
  if (!Number.isFinite(value)) return value < 0 ? "-inf" : "inf";
  const [digits, exponent] = value.toExponential().split("e");
  const scientific = `${digits}e${exponent[0]}${exponent.slice(1).padStart(2, "0")}`;
  const plain = String(value);
  return plain.includes("e") || plain.length > scientific.length ? scientific : plain;
}

/** The result of `read`. A part that is not needed and cannot be read is left out. */
function read_if_possible(left_out, otherwise, read) {
  try {
    return read();
  } catch (error) {
    if (!(error instanceof FclibError)) throw error;
    left_out.push(error.message);
    return otherwise;
  }
}

/** A group of a file, and its path. */
class Group {
  constructor(library, file, group, path) {
    Object.assign(this, { library, file, group, path });
    this.found = new Map(); // by name: HDF5 takes long to look a name up
  }

  child(name) {
    return (this.path === "/" ? "/" : `${this.path}/`) + name;
  }

  /** The object of a name, or null. A link to nothing, or into another file, is refused. */
  get(name) {
    if (!this.found.has(name)) this.found.set(name, this.#look_up(name));
    return this.found.get(name);
  }

  #look_up(name) {
    const path = this.child(name);
    try {
      this.names ??= this.group.keys();
    } catch {
      fail(path, "cannot be looked up by HDF5 (the file is damaged)");
    }
    if (!this.names.includes(name)) return null;
    const { Group: Groups, Dataset, Datatype, ExternalLink } = this.library;
    const { filename, obj_path } = this.group.get_external_link(path);
    if (filename !== undefined) {
      fail(
        path,
        `is an external link to ${quoted(obj_path)} of the file ${quoted(filename)}, ` +
          "which is not there: copy what it links to into this file",
      );
    }
    const target = this.group.get_link(path);
    let found = null;
    try {
      found = this.group.get(name);
      // if a link leads in a circle, the answer of h5wasm is arbitrary
      if (target !== null && found instanceof Groups) found.keys();
      if (target !== null && found instanceof Dataset) found.metadata;
    } catch {
      found = null;
    }
    if ([Groups, Dataset, Datatype].some((type) => found instanceof type)) return found;
    if (target !== null) fail(path, `is a link to ${quoted(target)}, which is not there`);
    if (found instanceof ExternalLink) fail(path, "is a link of a kind that is not followed");
    return fail(path, "cannot be looked up by HDF5 (the file is damaged)");
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

  /** A dataset with its properties. */
  dataset(name) {
    const path = this.child(name);
    const found = this.get(name);
    if (found === null) fail(path, "the dataset is missing");
    if (!(found instanceof this.library.Dataset)) {
      fail(path, "is not a dataset that HDF5 can open");
    }
    let metadata;
    try {
      metadata = found.metadata;
    } catch {
      fail(path, "is not a dataset that HDF5 can open");
    }
    const shape = metadata.shape ?? [0];
    return { path, dataset: found, metadata, shape, size: product(shape) };
  }

  /** The places at which the file keeps the data of a dataset, as far as they are known. */
  place_of({ path, metadata }) {
    let place = {};
    try {
      const { module, file_id, layouts } = this.file;
      const reference = Uint8Array.from(module.create_object_reference(file_id, path));
      place = layouts.layout_of(Number(new DataView(reference.buffer).getBigUint64(0, true)));
    } catch {
      // if it is damaged, HDF5 will refuse it too
    }
    if (metadata.virtual_sources || place.external) {
      fail(path, "keeps its data in other places, which are not read");
    }
    return place;
  }

  /** Throws if HDF5 would ask for more memory than the file has data, or unpack data blindly. */
  require_chunks({ path, dataset, metadata, size }, entry_size) {
    if (!metadata.chunks) return;
    const chunk = product(metadata.chunks);
    if (
      chunk < 1 ||
      size / chunk > Math.max(1024, this.file.size) ||
      chunk * entry_size > Math.max(2 ** 26, best_compression * this.file.size)
    ) {
      fail(path, "has chunks that the file does not hold");
    }
    if (this.filters_of(dataset).some(({ id }) => filters_not_read.has(id))) {
      fail(path, "is packed by a filter that is not read (n-bit or scale-offset)");
    }
  }

  filters_of(dataset) {
    try {
      return dataset.filters;
    } catch {
      return [];
    }
  }

  /** Throws if entries were never written: HDF5 would read its fill value for them. */
  require_written({ path, metadata, shape, size }, { unwritten, chunks }) {
    if (size === 0) return;
    if (unwritten) fail(path, "was declared and never written: its data are missing");
    if (chunks === undefined || !metadata.chunks) return;
    const needed = product(shape.map((extent, k) => Math.ceil(extent / metadata.chunks[k])));
    if (chunks < needed) fail(path, "was written in part: some of its data are missing");
  }

  /** A dataset of numbers, looked at before memory is asked for. */
  open_numbers(name) {
    const opened = this.dataset(name);
    const { path, metadata, size } = opened;
    if (metadata.type !== INTEGER && metadata.type !== FLOAT) fail(path, "does not hold numbers");
    const bytes = size * metadata.size;
    const place = this.place_of(opened);
    const stored = Math.min(place.bytes ?? this.file.size, this.file.size);
    if (bytes > small_dataset && bytes > best_compression * stored) {
      fail(path, `declares ${BigInt(size)} entries, but the file does not hold them`);
    }
    this.require_chunks(opened, metadata.size);
    this.require_written(opened, place);
    if (size > largest) fail(path, `has ${size} entries, more than can be numbered`);
    if (!widths_read[metadata.type].includes(metadata.size)) {
      fail(path, `has numbers of ${metadata.size} bytes each, which are not read in a page`);
    }
    return opened;
  }

  /** The values of a dataset of numbers, of whatever shape. */
  numbers(name, integers) {
    const { path, dataset, metadata, size } = this.open_numbers(name);
    const other = this.filters_of(dataset).find(({ id }) => !filters_read.has(id));
    if (other && size > 0) {
      const { id, name: filter } = other;
      fail(path, `is packed by a filter that is not installed (${filter}, number ${id})`);
    }
    let values = null;
    try {
      values = size === 0 ? [] : dataset.value;
    } catch {
      // it stays null
    }
    if (values === null || values === undefined) {
      fail(path, "cannot be read (the file is damaged or cut short)");
    }
    if (!ArrayBuffer.isView(values) && !Array.isArray(values)) values = [values];
    if (!integers) return values instanceof Float64Array ? values : Float64Array.from(values, Number);
    if (values instanceof Int32Array) return values;
    return Int32Array.from(values, (value, k) => {
      const fits = value >= -largest - 1 && value <= largest;
      if (metadata.type === FLOAT && !(fits && Number.isInteger(value))) {
        fail(`${path}[${k}]`, `${shortest(value)} is not an integer of 32 bits`);
      }
      if (!fits) {
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

  /** Whether a dataset was declared and never written. */
  is_unwritten(name) {
    if (!(this.get(name) instanceof this.library.Dataset)) return false;
    const opened = this.dataset(name);
    return opened.size > 0 && this.place_of(opened).unwritten === true;
  }

  text(name) {
    const opened = this.dataset(name);
    const { path, metadata, shape, size } = opened;
    const as_bytes = metadata.type === INTEGER && metadata.size === 1 && is_flat(shape);
    if (metadata.type !== STRING && !as_bytes) fail(path, "does not hold text");
    if (size !== 1 && !as_bytes) fail(path, `holds ${size} texts, expected one`);
    const length = as_bytes ? size : metadata.size;
    const place = this.place_of(opened);
    this.require_chunks(opened, as_bytes ? 1 : length);
    const stored = Math.min(place.bytes ?? this.file.size, this.file.size);
    if (!metadata.vlen && length > small_dataset && length > stored) {
      fail(path, `declares a text of ${length} bytes that the file does not hold`);
    }
    this.require_written(opened, place);
    if (size === 0) return "";
    return this.#text_of(path, length, metadata.vlen);
  }

  /** The bytes as UTF-8. If they are marked as ASCII, h5wasm takes them for Latin letters. */
  #text_of(path, length, vlen) {
    const { module, file_id } = this.file;
    const place = module._malloc(length);
    if (place === 0) fail(path, "cannot be read");
    try {
      module.get_dataset_data(file_id, path, null, null, null, BigInt(place));
      const memory = module.HEAPU8;
      let [from, to] = [place, place + length];
      if (vlen) {
        from = new DataView(memory.buffer).getUint32(place, true);
        to = from === 0 ? 0 : memory.length;
      }
      const end = memory.subarray(from, to).indexOf(0);
      const text = new TextDecoder().decode(memory.slice(from, end < 0 ? to : from + end));
      if (vlen) module.reclaim_vlen_memory(file_id, path, "", BigInt(place));
      return text;
    } catch {
      return fail(path, "cannot be read");
    } finally {
      module._free(place);
    }
  }
}

function shortened(values, length, where) {
  if (values.length < length) {
    fail(where, `has ${values.length} entries, expected ${length}`);
  }
  return values.length > length ? values.slice(0, length) : values;
}

function read_matrix_info(group, left_out) {
  const info = { comment: "", conditioning: 0, determinant: 0, rank: 0 };
  let known = false;
  for (const name of Object.keys(info)) {
    read_if_possible(left_out, undefined, () => {
      if (!group.has(name)) return;
      info[name] = name === "comment" ? group.text(name) : group.number(name, name === "rank");
      known = true;
    });
  }
  return known ? info : undefined;
}

/** Whether the group of a matrix has one triangle, which stands for both. */
function is_packed(group) {
  if (!Object.keys(group.group.attrs).includes(packed_mark)) return false;
  const { type, total_size } = group.group.attrs[packed_mark].metadata;
  let value = NaN;
  if ([INTEGER, FLOAT, ENUM].includes(type) && total_size === 1) {
    const found = group.group.get_attribute(packed_mark);
    value = Number(ArrayBuffer.isView(found) ? found[0] : found);
  }
  if (value !== 0 && value !== 1) {
    fail(
      `${group.path}, attribute ${packed_mark}`,
      "is not a number: expected 1 for one triangle of a symmetric matrix, or 0",
    );
  }
  return value === 1;
}

/** Throws if the count is 0 but there are values: then the count or the pointers are missing. */
function require_counted(x, counted, counter) {
  if (counted > 0 || x.length <= 1) return;
  const given = x.reduce((all, value) => all + (value !== 0 ? 1 : 0), 0);
  if (given > 0) {
    fail(
      counter,
      `says that there is no entry, but x has ${x.length}, of which ${given} are not 0: ` +
        "the pointers or the count are missing",
      "problem",
    );
  }
}

function note_uncounted(x, counted, group, left_out) {
  if (!x.subarray(counted).some((value) => value !== 0)) return;
  left_out.push(
    `${group.child("x")}: has ${x.length} entries, of which ${counted} are counted`,
  );
}

function read_matrix(parent, name, left_out) {
  const group = parent.open(name);
  const packed = is_packed(group);
  const rows = group.number("m", true);
  const cols = group.number("n", true);
  if (rows < 0) fail(group.child("m"), "is negative");
  if (cols < 0) fail(group.child("n"), "is negative");
  const nz = group.number("nz", true);
  const matrix = { storage: "dense", rows, cols };
  if (nz === -3) {
    if (group.has("x") && !is_flat(group.open_numbers("x").shape)) {
      fail(group.child("x"), "has more than one dimension, expected one, by columns");
    }
    matrix.x = group.numbers("x", false);
  } else if (nz >= -2) {
    const p = group.numbers("p", true);
    const i = group.numbers("i", true);
    const x = group.numbers("x", false);
    let entries = nz;
    if (nz >= 0) {
      matrix.storage = "triplet";
      // CSparse has room in x alone: 3.1 writes as many places as are counted
      if (p.length > 0) require_counted(x, nz, group.child("nz"));
      matrix.p = shortened(p, nz, group.child("p"));
    } else {
      matrix.storage = nz === -1 ? "csc" : "csr";
      matrix.p = p;
      entries = p.length > 0 ? p[p.length - 1] : -1;
      if (entries < 0) fail(group.child("p"), "has no valid last pointer");
      require_counted(x, entries, group.child("p"));
    }
    note_uncounted(x, entries, group, left_out);
    // nzmax may leave room at the end
    matrix.i = shortened(i, entries, group.child("i"));
    matrix.x = shortened(x, entries, group.child("x"));
  } else {
    fail(
      group.child("nz"),
      `${nz} is no storage: expected the number of triplets, -1 (CSC), -2 (CSR) or -3 (dense)`,
    );
  }
  const info = read_matrix_info(group, left_out);
  return { matrix: info ? { ...matrix, info } : matrix, packed, path: group.path };
}

/** Calls visit(row, col, value) with each entry of a valid matrix. */
function for_each_entry({ storage, rows, cols, p, i, x }, visit) {
  if (storage === "triplet") x.forEach((value, k) => visit(i[k], p[k], value));
  if (storage === "dense") x.forEach((value, k) => visit(k % rows, Math.floor(k / rows), value));
  if (storage !== "csc" && storage !== "csr") return;
  const majors = storage === "csc" ? cols : rows;
  for (let major = 0; major < majors; ++major) {
    for (let k = p[major]; k < p[major + 1]; ++k) {
      if (storage === "csc") visit(i[k], major, x[k]);
      else visit(major, i[k], x[k]);
    }
  }
}

/** Triplets by columns (csc) or by rows (csr): sorted, those at one place added. */
function compressed(storage, size, rows, cols, values) {
  const [majors, minors] = storage === "csc" ? [cols, rows] : [rows, cols];
  const order = [...values.keys()].sort(
    (a, b) => majors[a] - majors[b] || minors[a] - minors[b] || a - b,
  );
  const p = new Int32Array(size + 1);
  const [i, x] = [[], []];
  let last = -1;
  for (const k of order) {
    if (last >= 0 && majors[last] === majors[k] && minors[last] === minors[k]) {
      x[x.length - 1] += values[k];
    } else {
      i.push(minors[k]);
      x.push(values[k]);
    }
    p[majors[k] + 1] = i.length;
    last = k;
  }
  for (let major = 1; major <= size; ++major) p[major] = Math.max(p[major], p[major - 1]);
  return { p, i: Int32Array.from(i), x: Float64Array.from(x) };
}

/** The symmetric matrix L + L^T - diag(L) of a valid triangle L. */
function symmetric_of_triangle(matrix, where) {
  const { storage, rows, cols } = matrix;
  if (rows !== cols) {
    const sizes = `${rows} rows and ${cols} columns`;
    fail(where, `is said to be a packed symmetric matrix, but has ${sizes}`, "problem");
  }
  const [i, p, x] = [[], [], []];
  let below = false;
  let above = false;
  const put = (row, col, value) => {
    i.push(row);
    p.push(col);
    x.push(value);
  };
  for_each_entry(matrix, (row, col, value) => {
    put(row, col, value);
    if (row === col) return;
    put(col, row, value);
    if (value !== 0 && row > col) below = true;
    if (value !== 0 && row < col) above = true;
  });
  if (below && above) {
    const words = "is said to be one triangle of a symmetric matrix, but has entries in both";
    fail(where, words, "problem");
  }
  if (storage === "dense") {
    const whole = new Float64Array(rows * cols);
    x.forEach((value, k) => {
      if (value !== 0) whole[i[k] + rows * p[k]] = value;
    });
    return { ...matrix, x: whole };
  }
  if (storage !== "triplet") return { ...matrix, ...compressed(storage, rows, i, p, x) };
  const [row, col] = [Int32Array.from(i), Int32Array.from(p)];
  return { ...matrix, i: row, p: col, x: Float64Array.from(x) };
}

/** /contacts or /bodies, if the group is ours; undefined otherwise. */
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
    const { type: kind } = group.dataset(key).metadata;
    if (kind === INTEGER || kind === FLOAT) table[key] = group.numbers(key, kind === INTEGER);
    if (kind === STRING) table[key] = group.text(key);
  }
  return table;
}

function read_info(structs, group, left_out) {
  const info = Object.fromEntries(structs.info.map(({ name }) => [name, ""]));
  read_if_possible(left_out, undefined, () => {
    if (!group.has("info")) return;
    const words = group.open("info");
    for (const name of Object.keys(info)) {
      info[name] = read_if_possible(left_out, "", () => (words.has(name) ? words.text(name) : ""));
    }
  });
  return info;
}

/** A problem, validated. */
function read_problem(fclib, root, kind, left_out) {
  const { structs } = fclib;
  const group = root.open(`fclib_${kind}`);
  const vectors = group.open("vectors");
  const problem = { kind };
  const triangles = [];
  for (const { name, type, required } of structs.problems[kind].fields) {
    const place = type === "vector" ? vectors : group;
    if (!required && !place.has(name)) continue;
    if (type === "matrix") {
      const { matrix, packed, path } = read_matrix(place, name, left_out);
      problem[name] = matrix;
      if (packed) triangles.push({ name, path });
    }
    if (type === "vector") problem[name] = place.numbers(name, false);
    if (type === "number") problem[name] = place.number(name, true);
  }
  problem.info = read_info(structs, group, left_out);
  read_if_possible(left_out, undefined, () => {
    const tables = ["contacts", "bodies"].map((name) => [name, read_table(root, name)]);
    Object.assign(problem, Object.fromEntries(tables.filter(([, table]) => table)));
  });
  fclib.validate(problem);
  // after this, as places are valid now
  for (const { name, path } of triangles) {
    problem[name] = symmetric_of_triangle(problem[name], path);
  }
  return problem;
}

function read_solution(structs, parent, name) {
  const group = parent.open(name);
  const solution = {};
  for (const { name: member, required } of structs.solution) {
    if (required || (group.has(member) && !group.is_unwritten(member))) {
      solution[member] = group.numbers(member, false);
    }
  }
  return solution;
}

/** The solution of a file; null if there is none, or if its reactions were never written. */
function solution_of(structs, root) {
  if (!root.has("solution")) return null;
  if (root.open("solution").is_unwritten("r")) {
    return fail("/solution/r", "was declared and never written");
  }
  return read_solution(structs, root, "solution");
}

function guesses_of(structs, root) {
  if (!root.has("guesses")) return [];
  const group = root.open("guesses");
  const number = group.number("number_of_guesses", true);
  if (number < 0) fail(group.child("number_of_guesses"), "is negative");
  const guesses = [];
  for (let k = 1; k <= number; ++k) guesses.push(read_solution(structs, group, String(k)));
  return guesses;
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

/** Where the superblock of HDF5 begins: at 0, 512, 1024, 2048, ...; undefined if there is none. */
function superblock_of(bytes) {
  for (let at = 0; at + signature.length <= bytes.length; at = at === 0 ? 512 : 2 * at) {
    if (signature.every((byte, k) => bytes[at + k] === byte)) return at;
  }
  return undefined;
}

/** Whether HDF5 would take the bytes for a file of its own. */
export function is_hdf5(bytes) {
  return superblock_of(bytes) !== undefined;
}

/** Why HDF5 cannot open a file. */
function what_is_wrong_with(bytes) {
  const at = superblock_of(bytes);
  if (bytes[at + 8] >= 2 && bytes[at + 11] !== 0) {
    return (
      "was not closed by the program that wrote it. If that program has ended, run " +
      "'h5clear -s FILE'; what it had not yet written is missing"
    );
  }
  return "cannot be opened by HDF5 (the file is damaged or cut short)";
}

/** HDF5 tells a console of each error, which is thrown here. */
function silence(files) {
  const stderr = files.streams[2];
  stderr.stream_ops = { ...stderr.stream_ops, write: (stream, buffer, offset, length) => length };
}

let checked = null;

/** Makes a read throw if HDF5 fails: h5wasm alone returns the old content of the memory. */
function check_reads(module) {
  if (module === checked) return;
  checked = module;
  const read = module.get_dataset_data;
  module.get_dataset_data = (...where) => {
    if (read(...where) < 0) throw new Error("HDF5 could not read a dataset");
  };
}

let count = 0;

/**
 * The content of an FCLIB file: { problem, solution, guesses, contacts, bodies, left_out }. `left_out`
 * has a line for each part that is not needed and could not be read.
 */
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
      fail("", what_is_wrong_with(bytes));
    }
    const { structs } = fclib;
    const layouts = new LayoutFile(bytes, superblock_of(bytes));
    const opened = { size: bytes.length, module, file_id: file.file_id, layouts };
    const root = new Group(library, opened, file, "/");
    const left_out = [];
    const problem = read_problem(fclib, root, kind_to_read(structs, root, kind), left_out);
    // if there are several problems, these belong to the first, the global one
    const own = problem.kind === Object.keys(structs.problems).find((one) => root.has(`fclib_${one}`));
    const of_own = (otherwise, read) =>
      own ? read_if_possible(left_out, otherwise, () => read(structs, root)) : otherwise;
    const solution = of_own(null, solution_of);
    const guesses = of_own([], guesses_of);
    const { contacts = null, bodies = null } = problem;
    return { problem, solution, guesses, contacts, bodies, left_out };
  } finally {
    try {
      file?.close();
    } finally {
      FS.unlink(name);
    }
  }
}
