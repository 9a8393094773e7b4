// what a visitor's own browser computes of a problem: the merits of the stored solution, and solves.
// The core is a module (docs/browser.md), in a worker: the page stays alive.
"use strict";
(() => {
  const { h, number, copyable } = Fclib;
  const MODULE = "assets/browser/fclib-worker.js";
  const LIMIT = 30; // [s] of a solve, where nothing else is said
  const GRACE = 5; // [s] after which a solver that did not look at its limit is ended
  const SAME = 1e-12;
  const MOST = 1000; // points of the curve

  let worker = null;
  const core = async () => {
    const { FclibWorker } = await import(new URL(MODULE, document.baseURI).href);
    return worker ||= new FclibWorker();
  };
  // who leaves a page leaves its work
  addEventListener("hashchange", () => { if (worker) worker.close(); });

  const read = async (file) => {
    const answer = await fetch(file.href);
    if (!answer.ok) throw new Error(`${file.href}: ${answer.status} ${answer.statusText}`);
    const bytes = await answer.arrayBuffer();
    // browsers have it at addresses of https and of this machine
    if (crypto.subtle) {
      const sum = [...new Uint8Array(await crypto.subtle.digest("SHA-256", bytes))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
      if (sum !== file.sha256) throw new Error(`${file.href} is another file than when the site was made: its SHA-256 is ${sum}`);
    }
    return (await core()).read(bytes);
  };

  /* the difference of two values, in words; what is not finite is stored as null */
  const compared = (stored, here) => {
    if (stored === null || !Number.isFinite(here)) return stored === null && !Number.isFinite(here) ? "neither is finite" : "one is not finite";
    const apart = Math.abs(stored - here);
    return apart <= SAME * Math.max(1, Math.abs(stored)) ? "equal to 1e-12" : `differs by ${number(apart)}`;
  };
  const meritTable = (stored, here) => Fclib.table({
    caption: "The stored solution: stored merits, and those recomputed here", page: 60,
    rows: Fclib.values.site.merits.filter(([name]) => name in stored).map(([name, doc]) => ({ name, doc, stored: stored[name], here: here[name], same: compared(stored[name], here[name]) })),
    columns: [{ key: "name", label: "part", head: true }, { key: "stored", label: "stored", type: "number" }, { key: "here", label: "here", type: "number" }, { key: "same", label: "compared", cell: (r) => h("span", { class: r.same.startsWith("differs") || r.same.startsWith("one") ? "bad" : "good" }, r.same) }, { key: "doc", label: "what it is", wrap: true }],
  });

  /* the error over time, as it falls */
  const curve = () => {
    const WIDTH = Fclib.isNarrow() ? 350 : 600, HEIGHT = 140, EDGE = 44;
    const make = (tag, attributes) => { const made = document.createElementNS("http://www.w3.org/2000/svg", tag); Fclib.set(made, attributes); return made; };
    const line = make("polyline", { fill: "none", stroke: "var(--c0)", "stroke-width": 2 });
    const top = make("text", { x: 4, y: 18 }), bottom = make("text", { x: 4, y: HEIGHT - 22 }), end = make("text", { x: WIDTH - 4, y: HEIGHT - 4, "text-anchor": "end" });
    const svg = make("svg", { class: "curve", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": "The error over time" });
    svg.append(line, top, bottom, end);
    let points = [];
    return { svg, add: (more) => {
      points.push(...more.filter(([, error]) => error > 0 && Number.isFinite(error)));
      while (points.length > MOST) points = points.filter((_, k) => k % 2 === 0 || k === points.length - 1);
      if (!points.length) return;
      const logs = points.map(([, error]) => Math.log10(error)), low = Math.min(...logs), high = Math.max(...logs), last = points[points.length - 1][2];
      const x = (time) => EDGE + (WIDTH - EDGE - 8) * (last > 0 ? time / last : 0), y = (log) => 12 + (HEIGHT - 40) * (high > low ? (high - log) / (high - low) : 0.5);
      line.setAttribute("points", points.map(([, , time], k) => `${x(time).toFixed(1)},${y(logs[k]).toFixed(1)}`).join(" "));
      top.textContent = number(10 ** high, 2);
      bottom.textContent = high > low ? number(10 ** low, 2) : "";
      end.textContent = `${number(last)} s`;
    } };
  };

  const field = (label, attributes) => {
    const input = h("input", { type: "number", step: "any", ...attributes });
    return { label: h("label", {}, label, input), value: (least, empty) => {
      if (input.value === "" && !input.validity.badInput && empty !== undefined) return empty;
      if (input.value === "" || !(Number(input.value) >= least)) throw new Error(`${label}: not a number of at least ${least}`);
      return Number(input.value);
    } };
  };

  /* solver, tolerance and limits, the error as it falls, a stop, and what came out */
  const solving = (problem, solvers, attempt) => {
    const chosen = h("select", {}, [...solvers].sort((a, b) => (b.name === "auto") - (a.name === "auto")).map(({ name, title }) => h("option", { value: name, title }, name)));
    const tolerance = field("tolerance", { value: "1e-8", min: 0 }), limit = field("time limit [s]", { value: String(LIMIT), min: 0.1 }), most = field("iterations", { value: "", min: 1, step: 1, placeholder: "its own" });
    const live = h("p", { class: "small", role: "status" }), picture = h("div", {});
    const rows = [], table = h("div", {});
    let run = null;
    const stop = h("button", { type: "button", disabled: true, onclick: () => run && run.stop() }, "Stop");
    const start = h("button", { type: "button", onclick: () => attempt(start, "", async () => {
      const tol = tolerance.value(0), seconds = limit.value(0.1), iterations = most.value(1, null), solver = chosen.value;
      const drawn = curve(), fclib = await core();
      picture.replaceChildren(drawn.svg);
      live.textContent = `${solver} runs`;
      const began = performance.now();
      const passed = () => (performance.now() - began) / 1e3;
      run = fclib.solve(problem, { solver, tol, time_limit: seconds, max_iterations: iterations }, ({ iteration, error, points }) => {
        live.textContent = `${solver}: iteration ${iteration}, error ${number(error)}, ${number(passed(), 2)} s`;
        drawn.add(points);
      });
      stop.disabled = false;
      const guard = setTimeout(() => run.stop(), 1e3 * (seconds + GRACE));
      let result;
      try { result = await run; } catch (error) { live.textContent = ""; throw error; } finally { clearTimeout(guard); stop.disabled = true; run = null; }
      const time = passed();
      drawn.add([[result.iterations, result.error, time]]);
      live.textContent = `${solver}: ${result.status} after ${result.iterations} iterations and ${number(time, 2)} s`;
      let merit = {}, why = null;
      // one that was stopped early has no reactions, or none of bilateral constraints
      try { merit = await fclib.merit(problem, result.solution); } catch (error) { why = error; }
      rows.unshift({ solver, tol, status: result.status, iterations: result.iterations, time, merit });
      table.replaceChildren(Fclib.table({
        caption: "What was solved here, the last first; its merits are recomputed from what the solver returned", rows, page: 20,
        columns: [{ key: "solver", label: "solver", head: true }, { key: "tol", label: "tolerance", format: Fclib.tolerance }, { key: "status", label: "status", cell: (r) => h("span", { class: r.status === "converged" ? "good" : "bad" }, r.status) }, { key: "iterations", label: "iterations", type: "number" }, { key: "time", label: "time [s]", type: "number" },
          ...Fclib.values.site.merits.map(([name, title]) => ({ key: name, label: name, title, type: "number", value: (r) => r.merit[name] ?? null }))],
      }));
      if (why) throw new Error(`The reactions of ${solver} cannot be judged: ${why.message}`);
    }) }, "Start");
    return [h("div", { class: "controls" }, h("label", {}, "solver", chosen), tolerance.label, limit.label, most.label, start, stop), live, picture, table];
  };

  /* the panel of a problem whose files the site has, where it has the module too */
  Fclib.computeIt = (record) => {
    const files = (record.files || []).filter((one) => one.path.endsWith(".hdf5") && (one.href || "").startsWith("files/"));
    const bytes = Fclib.values.site.module;
    if (!files.length || !bytes) return [];
    const head = h("h2", { id: "compute" }, "Check it here, solve it here");
    if (location.protocol === "file:") {
      const folder = decodeURIComponent(location.pathname).replace(/\/[^/]*$/, "");
      return [head, h("p", {}, "This page can check the stored solution, and solve the problem, in your browser; but a browser loads no module from a folder of files. This serves the site to this machine alone:"),
        copyable(`fclib report --serve --out '${folder.replaceAll("'", "'\\''")}'`, "the command that serves the site")];
    }
    const said = h("p", { class: "small", role: "status" }), merits = h("div", {}), solved = h("div", {});
    let file = files[0];
    const opened = new Map();
    const contents = (one) => {
      if (!opened.has(one)) opened.set(one, read(one).catch((error) => { opened.delete(one); throw error; }));
      return opened.get(one);
    };
    const attempt = async (button, text, act) => {
      button.disabled = true;
      said.className = "small";
      said.textContent = text;
      try { await act(); said.textContent = ""; } catch (error) { said.className = "small bad"; said.textContent = error.message; }
      button.disabled = false;
    };
    const check = h("button", { type: "button", onclick: () => attempt(check, "The file is read and its solution judged.", async () => {
      const own = file, { problem, solution } = await contents(own);
      if (!own.merit || !solution) throw new Error("The file has no solution to check.");
      const here = await (await core()).merit(problem, solution);
      if (own === file) merits.replaceChildren(meritTable(own.merit, here));
    }) }, "Check it here");
    const solve = h("button", { type: "button", onclick: () => attempt(solve, "The file is read.", async () => {
      const own = file, { problem } = await contents(own), solvers = await (await core()).solvers_for(problem);
      if (own === file) solved.replaceChildren(...solving(problem, solvers, attempt));
    }) }, "Solve it here");
    const form = files.length > 1 ? h("label", {}, "file", h("select", { onchange: (e) => {
      if (worker) worker.close();
      file = files[Number(e.target.value)];
      merits.replaceChildren();
      solved.replaceChildren();
    } }, files.map((one, k) => h("option", { value: k }, one.what)))) : null;
    return [head, h("p", { class: "small" }, `By the core itself, in this browser: nothing is sent. ${number(bytes / 1e6)} MB are loaded for it, once.`), h("div", { class: "controls" }, form, check, solve), said, merits, solved];
  };
})();
