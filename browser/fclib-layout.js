// The places at which an HDF5 file keeps the numbers of a dataset. h5wasm does not tell them, so this
// reads the header of the dataset, after "HDF5 File Format Specification", III.A (B-trees), IV.A
// (object headers) and VII (indices of chunks).

const CONTIGUOUS = 1;
const CHUNKED = 2;
const LAYOUT = 8;
const EXTERNAL = 7;
const CONTINUED = 16;
const SINGLE_CHUNK = 1; // this and the next are indices of chunks
const FIXED_ARRAY = 3;
const EXTENSIBLE_ARRAY = 4;
const TREE_2 = 5;
const most_blocks = 4096; // of one header; a damaged file may have a cycle of them

/** Numbers of a file from a place on. Throws RangeError beyond its end. */
class Cursor {
  constructor(file, at) {
    this.file = file;
    this.at = at;
  }

  number(size) {
    let value = 0;
    for (let k = size - 1; k >= 0; --k) value = 256 * value + this.file.view.getUint8(this.at + k);
    this.at += size;
    return value;
  }

  skip(size) {
    this.at += size;
    return this;
  }

  /** A place in the file; null if there is none. */
  address() {
    const size = this.file.address_size;
    const from = this.at;
    const value = this.number(size);
    for (let k = 0; k < size; ++k) {
      if (this.file.view.getUint8(from + k) !== 255) return value + this.file.base;
    }
    return null;
  }

  length() {
    return this.number(this.file.length_size);
  }

  word() {
    return String.fromCharCode(...[0, 1, 2, 3].map(() => this.number(1)));
  }
}

/** A file whose superblock begins at a place. */
export class LayoutFile {
  constructor(bytes, superblock) {
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.base = 0;
    const version = this.view.getUint8(superblock + 8);
    const sizes = new Cursor(this, superblock + (version < 2 ? 13 : 9));
    this.address_size = sizes.number(1);
    this.length_size = sizes.number(1);
    const bases = superblock + (version < 2 ? (version === 1 ? 28 : 24) : 12);
    this.base = new Cursor(this, bases).number(this.address_size);
  }

  /**
   * The facts of the header at a place: whether the data are in other files (`external`), whether
   * they have no room in this file (`unwritten`), their size (`bytes`), and their number of chunks.
   * A member that is not known is undefined.
   */
  layout_of(address) {
    const found = { external: false };
    for (const { type, at } of this.#messages(address + this.base)) {
      if (type === EXTERNAL) found.external = true;
      if (type === LAYOUT) Object.assign(found, this.#layout(new Cursor(this, at)));
    }
    return found;
  }

  *#messages(address) {
    const start = new Cursor(this, address);
    const modern = start.word() === "OHDR";
    const blocks = [];
    let tracked = false;
    if (modern) {
      const flags = start.skip(1).number(1);
      tracked = (flags & 4) !== 0;
      start.skip((flags & 32 ? 16 : 0) + (flags & 16 ? 4 : 0));
      const size = start.number(2 ** (flags & 3));
      blocks.push([start.at, size]);
    } else {
      start.skip(4); // word() read four bytes of sixteen
      blocks.push([start.at + 8, start.number(4)]);
    }
    for (let k = 0; k < blocks.length && k < most_blocks; ++k) {
      const [from, size] = blocks[k];
      const head = modern ? (tracked ? 6 : 4) : 8;
      for (let at = from; at + head <= from + size; ) {
        const cursor = new Cursor(this, at);
        const type = cursor.number(modern ? 1 : 2);
        const length = cursor.number(2);
        const data = at + head;
        if (type === CONTINUED) {
          const next = new Cursor(this, data);
          const place = next.address();
          const room = next.length();
          // of the newer format it has a word before and a checksum after
          blocks.push(modern ? [place + 4, room - 8] : [place, room]);
        } else {
          yield { type, at: data };
        }
        at = data + length;
      }
    }
  }

  #layout(cursor) {
    const version = cursor.number(1);
    if (version < 3) return {}; // of HDF5 before 1.6.3
    const kind = cursor.number(1);
    if (kind === CONTIGUOUS) {
      const place = cursor.address();
      return { unwritten: place === null, bytes: place === null ? 0 : cursor.length() };
    }
    if (kind !== CHUNKED) return {};
    if (version === 3) {
      const dimensions = cursor.number(1);
      const place = cursor.address();
      if (place === null) return { unwritten: true, bytes: 0, chunks: 0 };
      return { unwritten: false, ...this.#chunks(place, dimensions, new Set()) };
    }
    const filtered = (cursor.number(1) & 2) !== 0;
    const dimensions = cursor.number(1);
    const width = cursor.number(1);
    const index = cursor.skip(dimensions * width).number(1);
    // the facts of an index that stand before its place
    const room = {
      [SINGLE_CHUNK]: filtered ? this.length_size + 4 : 0,
      [FIXED_ARRAY]: 1,
      [EXTENSIBLE_ARRAY]: 5,
      [TREE_2]: 6,
    }[index];
    if (room === undefined) return {};
    const place = cursor.skip(room).address();
    if (place === null) return { unwritten: true, bytes: 0, chunks: 0 };
    const chunks = {
      [SINGLE_CHUNK]: () => 1,
      [FIXED_ARRAY]: () => this.#chunks_of_array(new Cursor(this, place)),
      // the number of the last chunk in the file; some before it may be missing
      [EXTENSIBLE_ARRAY]: () => new Cursor(this, place + 12 + 4 * this.length_size).length(),
      [TREE_2]: () => new Cursor(this, place + 18 + this.address_size).length(),
    }[index]();
    return { unwritten: chunks === 0, chunks };
  }

  /** The number of chunks for which a fixed array has a place. */
  #chunks_of_array(header) {
    const entry = header.skip(6).number(1);
    const page = 2 ** header.number(1);
    const entries = header.length();
    const block = header.address();
    if (block === null) return 0;
    const data = block + 6 + this.address_size;
    if (entries <= page) return this.#places(data, entry, entries);
    const pages = Math.ceil(entries / page);
    const first = data + Math.ceil(pages / 8) + 4; // after the bits and a checksum
    let sum = 0;
    for (let k = 0; k < pages; ++k) {
      const made = this.view.getUint8(data + (k >> 3)) & (128 >> (k & 7));
      const size = Math.min(page, entries - k * page);
      if (made) sum += this.#places(first + k * (page * entry + 4), entry, size);
    }
    return sum;
  }

  /** The number of these entries that have an address. */
  #places(from, entry, count) {
    let sum = 0;
    for (let k = 0; k < count; ++k) {
      if (new Cursor(this, from + k * entry).address() !== null) sum += 1;
    }
    return sum;
  }

  /** The chunks below a node of a B-tree, and the bytes that they take. Each node counts once. */
  #chunks(place, dimensions, seen) {
    if (seen.has(place)) throw new RangeError("a B-tree of a damaged file has a cycle");
    seen.add(place);
    const node = new Cursor(this, place);
    if (node.word() !== "TREE") throw new RangeError("there is no node of a B-tree");
    const level = node.skip(1).number(1);
    const used = node.number(2);
    node.skip(2 * this.address_size);
    const sum = { chunks: 0, bytes: 0 };
    for (let k = 0; k < used; ++k) {
      const bytes = node.number(4);
      const child = node.skip(4 + 8 * dimensions).address();
      const below = level > 0 ? this.#chunks(child, dimensions, seen) : { chunks: 1, bytes };
      sum.chunks += below.chunks;
      sum.bytes += below.bytes;
    }
    return sum;
  }
}
