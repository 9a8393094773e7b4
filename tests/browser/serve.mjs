// Answers calls of the module for browsers, one a line of JSON: tests/browser_module.py asks them.
//
//   node serve.mjs FOLDER
//
// Arrays travel as { dtype, data }, the bytes in base64: as exact as they are.

import { createInterface } from "node:readline";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const { load } = await import(pathToFileURL(join(resolve(process.argv[2]), "fclib.js")));
const fclib = await load();
const types = { f8: Float64Array, i4: Int32Array, u1: Uint8Array };

function decoded(value) {
  if (Array.isArray(value)) return value.map(decoded);
  if (value === null || typeof value !== "object") return value;
  if ("dtype" in value) {
    const bytes = Uint8Array.from(Buffer.from(value.data, "base64"));
    return new types[value.dtype](bytes.buffer);
  }
  return Object.fromEntries(Object.entries(value).map(([key, one]) => [key, decoded(one)]));
}

function encoded(value) {
  if (ArrayBuffer.isView(value)) {
    const dtype = Object.keys(types).find((name) => value instanceof types[name]);
    const bytes = Buffer.from(value.buffer, value.byteOffset, value.byteLength);
    return { dtype, data: bytes.toString("base64") };
  }
  if (typeof value === "number" && !Number.isFinite(value)) return { number: String(value) };
  if (Array.isArray(value)) return value.map(encoded);
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([key, one]) => [key, encoded(one)]));
}

const own = {
  structs: () => fclib.structs,
  /** A solve by a clock that stands still, so that no report depends on the machine's speed. */
  solve_still: (problem, settings) => fclib.solve(problem, { ...settings, clock: () => 0 }),
  /** A solve that is stopped after some reports; what these had. */
  solve_watched: (problem, settings, most) => {
    const reports = [];
    const result = fclib.solve(problem, settings, ({ iteration, error, stage, r }) => {
      reports.push({ iteration, error, stage, size: r?.length ?? 0 });
      return reports.length < most;
    });
    return { result, reports };
  },
  solve_throwing: (problem) => {
    try {
      fclib.solve(problem, {}, () => {
        throw new RangeError("of the page");
      });
    } catch (error) {
      return error.message;
    }
    return "nothing was thrown";
  },
  /** CPU seconds of so many solves, one after another. */
  cpu: (problem, settings, times) => {
    const before = process.cpuUsage();
    for (let k = 0; k < times; ++k) fclib.solve(problem, settings);
    const { user, system } = process.cpuUsage(before);
    return (user + system) / 1e6;
  },
};

for await (const line of createInterface({ input: process.stdin })) {
  const { name, values } = decoded(JSON.parse(line));
  let answer;
  try {
    const value = await (own[name] ?? fclib[name].bind(fclib))(...values);
    answer = { value: encoded(value ?? null) };
  } catch (error) {
    answer = { error: { name: error.name, kind: error.kind ?? "", message: error.message } };
  }
  process.stdout.write(`${JSON.stringify(answer)}\n`);
}
