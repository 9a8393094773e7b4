// What workshop/tables/hdf5_reader.py asks: each line of the input is { reader, path, times }, and the
// answer says whether the file is read, and in how many milliseconds.
//
//   node hdf5_reader.mjs FOLDER         a folder with the reader of pages and h5wasm

import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const folder = resolve(process.argv[2]);
const from = (name) => import(pathToFileURL(join(folder, name)));
const { read_hdf5 } = await from("fclib-hdf5.js");
const library = await from("hdf5_hl.js");
const { FS } = await library.ready;

// the fields of the two formulations whose files are read; the core has them, and validates
const types = { spacedim: "number", M: "matrix", H: "matrix", G: "matrix", W: "matrix" };
Object.assign(types, { V: "matrix", R: "matrix" });
const optional = new Set(["G", "b", "V", "R", "s"]);
const fields = (names) =>
  names.split(" ").map((name) => {
    return { name, type: types[name] ?? "vector", required: !optional.has(name) };
  });
const problems = {
  global: { fields: fields("spacedim M H G mu f w b") },
  local: { fields: fields("spacedim W V R mu q s") },
};
const info = ["title", "description", "math_info"].map((name) => ({ name }));
const solution = ["v", "u", "r", "l"].map((name) => ({ name, required: name === "r" }));
const core = { structs: { problems, info, solution }, validate() {} };

/** All datasets of a group as h5wasm gives them, without a rule of ours. */
function values_of(group) {
  return Object.fromEntries(
    group.keys().map((name) => {
      const found = group.get(name);
      if (found === null) throw new Error(`${name} cannot be opened`);
      return [name, found.type === "Group" ? values_of(found) : found.value];
    }),
  );
}

const readers = {
  fclib: (bytes) => read_hdf5(core, bytes),
  async h5wasm(bytes) {
    FS.writeFile("plain.hdf5", bytes);
    const file = new library.File("plain.hdf5", "r");
    try {
      return values_of(file);
    } finally {
      file.close();
      FS.unlink("plain.hdf5");
    }
  },
};

for await (const line of createInterface({ input: process.stdin })) {
  const { reader, path, times } = JSON.parse(line);
  const bytes = new Uint8Array(readFileSync(path));
  const answer = { read: true, ms: Infinity };
  try {
    for (let k = 0; k < times; ++k) {
      const start = performance.now();
      await readers[reader](bytes);
      answer.ms = Math.min(answer.ms, performance.now() - start);
    }
  } catch {
    answer.read = false;
  }
  process.stdout.write(`${JSON.stringify(answer)}\n`);
}
