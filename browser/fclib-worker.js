// FCLIB in a worker of the page: all functions of fclib.js, each as a promise, and solves that can be
// watched and stopped.
//
//   import { FclibWorker } from "./fclib-worker.js";
//   const fclib = new FclibWorker();
//   const merit = await fclib.merit(problem, solution);
//   const run = fclib.solve(problem, { solver: "nsgs" }, (report) => draw(report.r));
//   stop_button.onclick = () => run.stop();
//   const result = await run;
//
// A browser loads modules from an address, not from a folder (file://).

import { FclibError } from "./fclib.js";

const interval = 30; // [ms] between reports to the page

export class FclibWorker {
  #worker = null;
  #calls = new Map();
  #next = 0;

  constructor() {
    // each function of Fclib by its name, as a promise
    return new Proxy(this, {
      get(self, name) {
        if (name in self) {
          const own = self[name];
          return typeof own === "function" ? own.bind(self) : own;
        }
        return name === "then" ? undefined : (...values) => self.#call(name, values);
      },
    });
  }

  #start() {
    if (this.#worker) return;
    this.#worker = new Worker(new URL(import.meta.url), { type: "module" });
    this.#worker.onmessage = ({ data }) => {
      const call = this.#calls.get(data.id);
      if (!call) return;
      if (data.reports) {
        call.reports(data.reports);
        return;
      }
      this.#calls.delete(data.id);
      if (data.error) {
        call.reject(new FclibError(data.error.kind, data.error.message, data.error.where));
      } else {
        call.resolve(data.value);
      }
    };
    this.#worker.onerror = (event) => {
      event.preventDefault();
      this.#end(new FclibError("internal", `the worker failed: ${event.message ?? "not loaded"}`));
    };
  }

  #end(error) {
    this.#worker?.terminate();
    this.#worker = null;
    const calls = [...this.#calls.values()];
    this.#calls.clear();
    for (const call of calls) call.reject(error);
  }

  #call(name, values, reports = undefined) {
    this.#start();
    const id = this.#next++;
    return new Promise((resolve, reject) => {
      this.#calls.set(id, { resolve, reject, reports });
      this.#worker.postMessage({ id, name, values, watched: Boolean(reports) });
    });
  }

  /** Ends the worker. Calls without an answer are rejected. A later call starts another worker. */
  close() {
    this.#end(new FclibError("internal", "the worker was closed"));
  }

  /**
   * As Fclib.solve, in the worker. Every 30 ms on_report gets the last report, with `r` as an array.
   * Its `points` has all [iteration, error, time] since the report before. The promise has stop():
   * then it resolves at once, with the last reported iterate and the status "interrupted".
   */
  solve(problem, settings = {}, on_report = undefined) {
    let last;
    const answer = this.#call("solve", [problem, settings], (reports) => {
      last = reports;
      on_report?.(reports);
    });
    let stopped;
    const either = new Promise((resolve, reject) => {
      answer.then(resolve, reject);
      stopped = resolve;
    });
    either.stop = () => {
      // a worker that computes reads no message: it is ended, and the next call starts another
      answer.catch(() => {});
      this.#end(new FclibError("internal", "the solve was stopped"));
      stopped({
        solver: settings.solver ?? "auto",
        status: "interrupted",
        converged: false,
        iterations: last?.iteration ?? 0,
        error: last?.error ?? Infinity,
        solution: { r: last?.r ?? new Float64Array(0) },
        certificate: null,
        stages: [],
      });
    };
    return either;
  }
}

// ---- the worker itself: it loads this file too

if (typeof WorkerGlobalScope !== "undefined" && self instanceof WorkerGlobalScope) {
  const loading = import("./fclib.js").then(({ load }) => load());

  const watch = (id) => {
    let told = -Infinity;
    let points = [];
    let latest;
    const tell = (report, now) => {
      postMessage({ id, reports: { ...report, points } });
      points = [];
      told = now;
    };
    return (report) => {
      const { iteration, error, time, stage } = report;
      points.push([iteration, error, time]);
      const now = performance.now();
      if (now - told < interval) return;
      latest = report.r ?? latest;
      tell({ iteration, error, time, stage, r: latest }, now);
    };
  };

  onmessage = async ({ data: { id, name, values, watched } }) => {
    try {
      const fclib = await loading;
      if (watched) values.push(watch(id));
      const own = name === "structs" || name === "version";
      postMessage({ id, value: own ? fclib[name] : await fclib[name](...values) });
    } catch (error) {
      const { kind = "internal", message, where = "" } = error;
      postMessage({ id, error: { kind, message, where } });
    }
  };
}
