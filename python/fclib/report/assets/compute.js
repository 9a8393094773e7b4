// what a visitor's own browser computes of a problem: the merits of the stored solution, and
// solves. The core is a module (docs/browser.md), in a worker: the page stays alive.
"use strict";
(() => {
  const { h, number, copyable } = Fclib;
  const MODULE = "assets/browser/fclib-worker.js";
  const LIMIT = 30; // [s] of a solve, if nothing else is given
  const GRACE = 5; // [s] after which a solver that did not look at its limit is ended
  const SAME = 1e-12;
  const MOST = 1000; // points of the curve
  const EDGE = 1e-6; // of a cone: what is so near to it, relative, is at it

  const HERE = ["127.0.0.1", "localhost"];

  let worker = null;
  const core = (Fclib.core = async () => {
    const { FclibWorker } = await import(new URL(MODULE, document.baseURI).href);
    return (worker ||= new FclibWorker());
  });
  // who leaves a page leaves its work
  addEventListener("hashchange", () => {
    if (worker) worker.close();
  });

  const read = async (file) => {
    const answer = await fetch(file.href);
    if (!answer.ok) throw new Error(`${file.href}: ${answer.status} ${answer.statusText}`);
    const bytes = await answer.arrayBuffer();
    // browsers have it at addresses of https and of this machine
    if (crypto.subtle) {
      const sum = [...new Uint8Array(await crypto.subtle.digest("SHA-256", bytes))]
        .map((byte) => byte.toString(16).padStart(2, "0"))
        .join("");
      if (sum !== file.sha256)
        throw new Error(
          `${file.href} is another file than when the site was made: its SHA-256 is ${sum}`,
        );
    }
    return (await core()).read(bytes, file.kind);
  };

  /* the difference of two values, in words; what is not finite is stored as null */
  const compared = (stored, here) => {
    if (stored === null || !Number.isFinite(here))
      return stored === null && !Number.isFinite(here) ? "neither is finite" : "one is not finite";
    const apart = Math.abs(stored - here);
    return apart <= SAME * Math.max(1, Math.abs(stored))
      ? "equal to 1e-12"
      : `differs by ${number(apart)}`;
  };
  const comparison = {
    key: "same",
    label: "compared",
    cell: (r) =>
      h(
        "span",
        { class: r.same.startsWith("differs") || r.same.startsWith("one") ? "bad" : "good" },
        r.same,
      ),
  };
  const meritTable = (stored, here) =>
    Fclib.table({
      caption: stored
        ? "The stored solution: stored merits, and those recomputed here"
        : "The solution of the file: its merits, computed here",
      page: 60,
      rows: Fclib.values.site.merits
        .filter(([name]) => name in (stored || here))
        .map(([name, doc]) => ({
          name,
          doc,
          here: here[name],
          ...(stored ? { stored: stored[name], same: compared(stored[name], here[name]) } : {}),
        })),
      columns: [
        { key: "name", label: "part", head: true },
        ...(stored ? [{ key: "stored", label: "stored", type: "number" }] : []),
        { key: "here", label: "here", type: "number" },
        ...(stored ? [comparison] : []),
        { key: "doc", label: "what it is", wrap: true },
      ],
    });

  /* the error over time, as it falls */
  const curve = () => {
    const WIDTH = Fclib.isNarrow() ? 350 : 600;
    const HEIGHT = 140;
    const SIDE = 44;
    const make = (tag, attributes) => {
      const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
      Fclib.set(made, attributes);
      return made;
    };
    const line = make("polyline", { fill: "none", stroke: "var(--c0)", "stroke-width": 2 });
    const top = make("text", { x: 4, y: 18 });
    const bottom = make("text", { x: 4, y: HEIGHT - 22 });
    const end = make("text", { x: WIDTH - 4, y: HEIGHT - 4, "text-anchor": "end" });
    const svg = make("svg", {
      class: "curve",
      viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
      role: "img",
      "aria-label": "The error over time",
    });
    svg.append(line, top, bottom, end);
    let points = [];
    return {
      svg,
      add: (more) => {
        points.push(...more.filter(([, error]) => error > 0 && Number.isFinite(error)));
        while (points.length > MOST)
          points = points.filter((_, k) => k % 2 === 0 || k === points.length - 1);
        if (!points.length) return;
        const logs = points.map(([, error]) => Math.log10(error));
        const low = Math.min(...logs);
        const high = Math.max(...logs);
        const last = points[points.length - 1][2];
        const x = (time) => SIDE + (WIDTH - SIDE - 8) * (last > 0 ? time / last : 0);
        const y = (log) => 12 + (HEIGHT - 40) * (high > low ? (high - log) / (high - low) : 0.5);
        line.setAttribute(
          "points",
          points.map(([, , time], k) => `${x(time).toFixed(1)},${y(logs[k]).toFixed(1)}`).join(" "),
        );
        top.textContent = number(10 ** high, 2);
        bottom.textContent = high > low ? number(10 ** low, 2) : "";
        end.textContent = `${number(last)} s`;
      },
    };
  };

  const field = (label, attributes) => {
    const input = h("input", { type: "number", step: "any", ...attributes });
    return {
      label: h("label", {}, label, input),
      value: (least, empty) => {
        if (input.value === "" && !input.validity.badInput && empty !== undefined) return empty;
        if (input.value === "" || !(Number(input.value) >= least))
          throw new Error(`${label}: not a number of at least ${least}`);
        return Number(input.value);
      },
    };
  };

  /* the options of a solver as fields: their values if they are not the defaults */
  const optionsOf = ({ name, options }) => {
    const fields = options.map((option) => {
      const { type, lowest, highest, choices } = option;
      const start = option.default;
      const bounded = (x) => (Number.isFinite(x) ? x : null);
      const range = [
        Number.isFinite(lowest) && `from ${number(lowest)}`,
        Number.isFinite(highest) && `to ${number(highest)}`,
      ]
        .filter(Boolean)
        .join(" ");
      const input =
        type === "bool"
          ? h("input", { type: "checkbox", checked: start })
          : choices.length
            ? h(
                "select",
                {},
                choices.map((one) => h("option", { value: one, selected: one === start }, one)),
              )
            : type === "text"
              ? h("input", { type: "text", value: start })
              : h("input", {
                  type: "number",
                  step: type === "int" ? 1 : "any",
                  min: bounded(lowest),
                  max: bounded(highest),
                  value: String(start),
                });
      const value = () => {
        if (type === "bool") return input.checked;
        if (choices.length || type === "text") return input.value;
        if (input.value === "") throw new Error(`${option.name}: not a number`);
        return Number(input.value);
      };
      const unit = option.unit && option.unit !== "1" ? ` [${option.unit}]` : "";
      // a field may write its default otherwise: what is not touched is left out
      return {
        name: option.name,
        value,
        start: value(),
        row: h(
          "div",
          { class: "option" },
          h("label", { class: type === "bool" ? "check" : null }, `${option.name}${unit}`, input),
          h("span", { class: "small soft" }, Fclib.prose(option.doc), range && ` (${range})`),
        ),
      };
    });
    const box = fields.length
      ? h(
          "details",
          {},
          h("summary", {}, `Options of ${name}`),
          fields.map(({ row }) => row),
        )
      : h("p", { class: "small soft" }, `${name} has no options.`);
    return {
      box,
      values: () =>
        Object.fromEntries(
          fields
            .map((one) => [one.name, one.value(), one.start])
            .filter(([, value, start]) => value !== start),
        ),
    };
  };

  /* the contacts as a picture colours them by reactions alone: without one, inside the cone, at its
     edge */
  const byCone = (problem, r) => {
    const d = problem.spacedim;
    const parts = d === 2 || (d === 3 && "mu_r" in problem) ? 2 : 3;
    return Array.from(problem.mu, (mu, k) => {
      const t = Math.hypot(...r.slice(d * k + 1, d * k + parts));
      return r[d * k] <= 0 ? 0 : t < (1 - EDGE) * mu * r[d * k] ? 1 : 2;
    }).join("");
  };

  /* solver, its options, tolerance and limits, the error as it falls, a stop, and what came out */
  const solving = (problem, solvers, attempt, figure, show) => {
    const settings = h("div", {});
    let own = null;
    const choose = () => {
      own = optionsOf(solvers.find(({ name }) => name === chosen.value));
      settings.replaceChildren(own.box);
    };
    const chosen = h(
      "select",
      { onchange: () => choose() },
      [...solvers]
        .sort((a, b) => (b.name === "auto") - (a.name === "auto"))
        .map(({ name, title }) => h("option", { value: name, title }, name)),
    );
    const tolerance = field("tolerance", { value: "1e-8", min: 0 });
    const limit = field("time limit [s]", { value: String(LIMIT), min: 0.1 });
    const most = field("iterations", { value: "", min: 1, step: 1, placeholder: "its own" });
    const live = h("p", { class: "small", role: "status" });
    const picture = h("div", {});
    const rows = [];
    const table = h("div", {});
    let run = null;
    const stop = h(
      "button",
      { type: "button", disabled: true, onclick: () => run && run.stop() },
      "Stop",
    );
    const start = h(
      "button",
      {
        type: "button",
        onclick: () =>
          attempt(start, "", async () => {
            const tol = tolerance.value(0);
            const seconds = limit.value(0.1);
            const iterations = most.value(1, null);
            const solver = chosen.value;
            const options = own.values();
            const drawn = curve();
            const fclib = await core();
            picture.replaceChildren(drawn.svg);
            live.textContent = `${solver} runs`;
            const began = performance.now();
            const passed = () => (performance.now() - began) / 1e3;
            run = fclib.solve(
              problem,
              { solver, tol, time_limit: seconds, max_iterations: iterations, options },
              ({ iteration, error, points, r }) => {
                live.textContent =
                  `${solver}: iteration ${iteration}, error ${number(error)}, ` +
                  `${number(passed(), 2)} s`;
                drawn.add(points);
                if (figure && r) figure.show(show(r, byCone(problem, r)));
              },
            );
            stop.disabled = false;
            const guard = setTimeout(() => run.stop(), 1e3 * (seconds + GRACE));
            let result;
            try {
              result = await run;
            } catch (error) {
              live.textContent = "";
              throw error;
            } finally {
              clearTimeout(guard);
              stop.disabled = true;
              run = null;
            }
            const time = passed();
            drawn.add([[result.iterations, result.error, time]]);
            live.textContent =
              `${solver}: ${result.status} after ` +
              `${Fclib.count(result.iterations, "iteration")} and ` +
              `${number(time, 2)} s`;
            let merit = {};
            let why = null;
            // one that was stopped early has no reactions, or none of bilateral constraints
            try {
              merit = await fclib.merit(problem, result.solution);
              if (figure)
                figure.show(
                  show(
                    result.solution.r,
                    Fclib.digits((await fclib.contact_merits(problem, result.solution)).status),
                  ),
                );
            } catch (error) {
              why = error;
            }
            if (result.certificate) {
              const { y, z } = result.certificate;
              live.textContent += `; ${proof(await fclib.check_certificate(problem, y, z))}`;
            }
            rows.unshift({
              solver: Object.keys(options).length
                ? `${solver} ${Object.entries(options)
                    .map(([key, value]) => `${key}=${value}`)
                    .join(" ")}`
                : solver,
              tol,
              status: result.status,
              iterations: result.iterations,
              time,
              merit,
            });
            table.replaceChildren(
              Fclib.table({
                caption:
                  "What was solved here, the last first; its merits are recomputed from what " +
                  "the solver returned",
                rows,
                page: 20,
                columns: [
                  { key: "solver", label: "solver", head: true },
                  { key: "tol", label: "tolerance", format: Fclib.tolerance },
                  {
                    key: "status",
                    label: "status",
                    cell: (r) =>
                      h("span", { class: r.status === "converged" ? "good" : "bad" }, r.status),
                  },
                  { key: "iterations", label: "iterations", type: "number" },
                  { key: "time", label: "time [s]", type: "number" },
                  ...Fclib.values.site.merits.map(([name, title]) => ({
                    key: name,
                    label: name,
                    title,
                    type: "number",
                    value: (r) => r.merit[name] ?? null,
                  })),
                ],
              }),
            );
            const next = Fclib.values.site.next[result.status];
            if (next) live.textContent += `. ${next[0].toUpperCase()}${next.slice(1)}.`;
            if (why) throw new Error(`The reactions of ${solver} cannot be judged: ${why.message}`);
          }),
      },
      "Start",
    );
    choose();
    return [
      h(
        "div",
        { class: "controls" },
        h("label", {}, "solver", chosen),
        tolerance.label,
        limit.label,
        most.label,
        start,
        stop,
      ),
      settings,
      live,
      picture,
      table,
    ];
  };

  /* what a certificate proves, once it has been checked */
  const statement = (bound) =>
    bound === Infinity
      ? "that there is no solution"
      : `that there is no solution of a norm below ${number(bound)}`;
  const proof = (found) => `the certificate proves ${found ? statement(found.bound) : "nothing"}`;
  const proofTable = (own, here) => {
    const stored = { ...own, bound: own.bound ?? Infinity };
    const parts = [
      [
        "gain",
        "how fast the contacts of the certificate close, each by its number in it: a proof " +
          "has more than 0",
      ],
      ["bound", "what it proves is of reactions of a smaller norm"],
    ];
    const proved = statement(stored.bound);
    const proves = here ? statement(here.bound) : "nothing";
    return Fclib.table({
      caption: "The stored certificate: what it proved when it was stored, and what it proves here",
      page: 60,
      rows: [
        {
          name: "proves",
          doc: "",
          stored: proved,
          here: proves,
          same: proved === proves ? "the same" : "differs",
        },
        ...parts
          .filter(([name]) => Number.isFinite(stored[name]))
          .map(([name, doc]) => ({
            name,
            doc,
            stored: stored[name],
            here: here && here[name],
            same: here ? compared(stored[name], here[name]) : "differs",
          })),
      ],
      columns: [
        { key: "name", label: "part", head: true },
        { key: "stored", label: "stored", type: "text", wrap: true },
        { key: "here", label: "here", type: "text", wrap: true },
        comparison,
        { key: "doc", label: "what it is", wrap: true },
      ],
    });
  };
  /* by number, as it is stored, to an array */
  const spread = (numbers, size) => {
    const all = new Float64Array(size);
    for (const [k, value] of Object.entries(numbers)) all[k] = value;
    return all;
  };

  /* check, solve and change a problem: buttons, and what they bring
     source(): {read() -> {problem, solution}, merit: as stored, view: as drawn, name}; it is asked
     at each press
     proven: {read(), proof: as stored}, if a run has proven that there is no solution */
  Fclib.panel = (source, more, proven) => {
    const statusLine = h("p", { class: "small", role: "status" });
    const merits = h("div", {});
    const proofs = h("div", {});
    const seen = h("div", {});
    const solved = h("div", {});
    const changed = h("div", {});
    let figure = null;
    const attempt = async (button, text, act) => {
      button.disabled = true;
      statusLine.className = "small";
      statusLine.textContent = text;
      try {
        await act();
        statusLine.textContent = "";
      } catch (error) {
        statusLine.className = "small bad";
        statusLine.textContent = error.message;
      }
      button.disabled = false;
    };
    const live = ({ view, name }) => {
      if (!figure && view && view.network) {
        figure = Fclib.live(view, name);
        seen.replaceChildren(figure);
      }
      return figure;
    };
    const check = h(
      "button",
      {
        type: "button",
        onclick: () =>
          attempt(check, "The file is read and its solution judged.", async () => {
            const own = source();
            const { problem, solution } = await own.read();
            if (!solution) throw new Error("The file has no solution to check.");
            const here = await (await core()).merit(problem, solution);
            if (own.current()) merits.replaceChildren(meritTable(own.merit, here));
          }),
      },
      "Check it here",
    );
    const certificate =
      proven &&
      h(
        "button",
        {
          type: "button",
          onclick: () =>
            attempt(certificate, "The file is read and the certificate checked.", async () => {
              const { problem } = await proven.read();
              const fclib = await core();
              const { nc, p } = await fclib.validate(problem);
              const { y, z } = proven.proof;
              proofs.replaceChildren(
                proofTable(
                  proven.proof,
                  await fclib.check_certificate(problem, spread(y, nc), spread(z, p)),
                ),
              );
            }),
        },
        "Check the certificate",
      );
    const prepared = async () => {
      const own = source();
      const { problem, solution } = await own.read();
      const fclib = await core();
      const solvers = await fclib.solvers_for(problem);
      if (!own.current()) return null;
      own.view ||= await Fclib.viewOf(fclib, problem);
      const picture = live(own);
      return {
        own,
        problem,
        solution,
        fclib,
        solvers,
        picture,
        show: picture && Fclib.shower(problem, own.view),
      };
    };
    const solve = h(
      "button",
      {
        type: "button",
        onclick: () =>
          attempt(solve, "The file is read.", async () => {
            const found = await prepared();
            if (found)
              solved.replaceChildren(
                ...solving(found.problem, found.solvers, attempt, found.picture, found.show),
              );
          }),
      },
      "Solve it here",
    );
    const say = (text) => {
      statusLine.className = "small bad";
      statusLine.textContent = text;
    };
    const change = h(
      "button",
      {
        type: "button",
        onclick: () =>
          attempt(change, "The file is read.", async () => {
            const found = await prepared();
            if (found)
              changed.replaceChildren(
                await Fclib.whatIf(
                  found.fclib,
                  found.problem,
                  found.solution,
                  found.own.view,
                  found.picture,
                  found.solvers,
                  say,
                ),
              );
          }),
      },
      "What if",
    );
    const clear = () => {
      figure = null;
      for (const box of [merits, seen, solved, changed]) box.replaceChildren();
    };
    return {
      clear,
      show: () => live(source()),
      elements: [
        h("div", { class: "controls" }, more, check, certificate, solve, change),
        statusLine,
        merits,
        proofs,
        changed,
        seen,
        solved,
      ],
    };
  };

  /* what a page says that was opened from a folder of files */
  Fclib.servedBy = (words) => {
    const folder = decodeURIComponent(location.pathname).replace(/\/[^/]*$/, "");
    const { serve = `fclib report --serve --out '${folder.replaceAll("'", "'\\''")}'` } =
      Fclib.values.site;
    return [
      h(
        "p",
        {},
        `${words} This serves it at an address of this machine, 127.0.0.1, which nobody else ` +
          "reaches:",
      ),
      copyable(serve, "the command that serves the page"),
    ];
  };

  /* the panel of a problem whose files the site has, if it has the module too */
  Fclib.computeIt = (record, view, name, runs) => {
    const files = (record.files || []).filter(
      (one) => one.path.endsWith(".hdf5") && (one.href || "").startsWith("files/"),
    );
    const bytes = Fclib.values.site.module;
    if (!files.length || !bytes) return [];
    const head = h("h2", { id: "compute" }, "Check it, solve it, change it here");
    if (location.protocol === "file:")
      return [
        head,
        ...Fclib.servedBy(
          "This page can check the stored solution, solve the problem and change it, in your " +
            "browser; but a browser loads no module from a folder of files.",
        ),
      ];
    let file = files[0];
    const opened = new Map();
    const contents = (one) => {
      if (!opened.has(one))
        opened.set(
          one,
          read(one).catch((error) => {
            opened.delete(one);
            throw error;
          }),
        );
      return opened.get(one);
    };
    const source = () => {
      const own = file;
      return {
        read: () => contents(own),
        current: () => own === file,
        merit: own.merit,
        view,
        name: `${name}-here`,
      };
    };
    const form =
      files.length > 1
        ? h(
            "label",
            {},
            "file",
            h(
              "select",
              {
                onchange: (e) => {
                  if (worker) worker.close();
                  file = files[Number(e.target.value)];
                  own.clear();
                },
              },
              files.map((one, k) => h("option", { value: k }, one.what)),
            ),
          )
        : null;
    // of a global problem or of its local form, as the run was
    const run = (runs || []).find((one) => one.certificate);
    const told =
      run &&
      files.find(({ path }) =>
        path.endsWith(run.form.startsWith("G") ? "-global.hdf5" : "-local.hdf5"),
      );
    const own = Fclib.panel(
      source,
      form,
      told && { read: () => contents(told), proof: run.certificate },
    );
    const host = location.hostname;
    const where = HERE.includes(host)
      ? `, and ${host}, where this page is served, is this machine alone`
      : "";
    return [
      head,
      h(
        "p",
        { class: "small" },
        `By the core itself, in this browser: nothing is sent${where}. ` +
          `${number(bytes / 1e6)} MB are loaded for it, once.`,
      ),
      run &&
        h(
          "p",
          { class: "small" },
          `By the certificate of ${run.solver}, the ` +
            `${run.form.startsWith("G") ? "global" : "local"} form has no solution` +
            (run.certificate.bound === null
              ? ""
              : ` of a norm below ${number(run.certificate.bound)}`) +
            ". It was checked in rational arithmetic when it was stored.",
        ),
      ...own.elements,
    ].filter(Boolean);
  };
})();
