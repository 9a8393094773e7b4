// one problem: its picture, facts, runs, files
"use strict";
(() => {
  const { h, load, facts, copyable } = Fclib;
  const {
    site,
    catalogue,
    problemHref,
    familyHref,
    solverLink,
    select,
    styleOf,
    yesOrNumber,
    status,
  } = Fclib.parts;

  const recipes = (row, read) => {
    const file = (read.global_file && row.global_file) || (read.local_file && row.local_file);
    const name = row.id.split("/").pop();
    const built = file && site().families.some((f) => f.name === row.family && f.parameters);
    const own = site().recipes[row.formulation];
    const filled = (text) =>
      text
        .replaceAll("{path}", file ? `collection/${file}` : `${name}.hdf5`)
        .replaceAll("{id}", row.id)
        .replaceAll("{family}", row.family);
    return [
      ["Command line", built ? own.build : own.shell],
      ["Python", built ? own.load : own.python],
      ["C", own.c],
      ["h5py, SciPy and MATLAB", own.h5py],
    ].map(([title, text]) => [h("h3", {}, title), copyable(filled(text))]);
  };
  Fclib.pages.problem = async (page, rest, params, keep) => {
    const s = site();
    const cat = await catalogue();
    const id = rest.join("/");
    const k = cat.places.get(id);
    if (k === undefined) throw new Fclib.NotHere(`There is no problem ${id} in this catalogue.`);
    const row = cat.rows[k];
    const { read } = cat;
    const [record, runs, view] = await Promise.all([
      Fclib.fileRecord(k),
      read.runs && row.runs ? load(`problems/${k}`) : null,
      read.view && row.view ? load(`views/${k}`) : null,
    ]);
    const neighbour = (j, text) =>
      j >= 0 && j < cat.size && read.family(j) === row.family
        ? h("a", { href: problemHref(read.id(j)) }, text)
        : null;
    page.append(
      h("h1", {}, id),
      h(
        "p",
        { class: "small" },
        [
          neighbour(k - 1, "← previous"),
          h(
            "a",
            { href: familyHref(read.collection ? row.collection : "", row.family) },
            row.family,
          ),
          neighbour(k + 1, "next →"),
        ]
          .filter(Boolean)
          .map((a, i) => [i ? " · " : "", a]),
      ),
      read.title && row.title && row.title !== id && h("p", {}, row.title),
    );
    const labelled = cat.columns
      .filter((c) => !c.hidden && !["id", "family", "view", "thumb"].includes(c.key))
      .map((c) => [
        c.label,
        row[c.key] === null || row[c.key] === undefined
          ? null
          : c.key === "best_solver"
            ? solverLink(row.best_solver)
            : c.key === "status"
              ? status(row.status)
              : c.key === "best_tol"
                ? Fclib.tolerance(row.best_tol)
                : c.key === "solved_by"
                  ? Fclib.percent(row.solved_by)
                  : yesOrNumber(row[c.key]),
      ]);
    const half = Math.ceil(labelled.length / 2);
    const docs = cat.columns
      .filter((c) => !c.hidden && c.doc && row[c.key] !== null && row[c.key] !== undefined)
      .map((c) => [c.label, c.doc]);
    page.append(
      h(
        "div",
        { class: "panel" },
        h("div", { class: "two" }, facts(labelled.slice(0, half)), facts(labelled.slice(half))),
        h("details", {}, h("summary", {}, "What these are"), facts(docs)),
      ),
    );
    const buildable = s.families.some(
      (f) =>
        f.name === row.family && f.parameters && f.set === (read.collection ? row.collection : ""),
    );
    page.append(
      ...Fclib.takeIt(id, record, buildable && Boolean(record.files)),
      h(
        "p",
        { class: "small" },
        h(
          "a",
          {
            href: "#cite",
            onclick: (e) => {
              e.preventDefault();
              document.getElementById("cite").scrollIntoView();
              document.querySelector("#cite + .copy button").focus({ preventScroll: true });
            },
          },
          "Cite it",
        ),
      ),
    );
    if (view) {
      const f = s.families.find(
        (one) => one.name === row.family && one.set === (read.collection ? row.collection : ""),
      );
      const own = read.number && row.number;
      const steps = f &&
        f.steps && {
          numbers: f.steps,
          count: f.steps.length,
          number: own,
          load: () => load(`sequences/${f.set}/${f.name}`),
          href: (n) => problemHref(`${f.set}/${f.name}/${String(n).padStart(4, "0")}`),
        };
      page.append(...Fclib.pictures(view, id, steps));
      if (view.merit)
        page.append(
          h("h2", {}, "Merit of the reference solution"),
          s.docs
            ? h(
                "p",
                { class: "small" },
                h("a", { href: `${s.docs}/mathematics.html` }, "How the error is defined"),
              )
            : "",
          Fclib.table({
            caption: "Recomputed from the file",
            rows: s.merits.filter(([name]) => name in view.merit),
            columns: [
              { key: 0, label: "part", head: true },
              { key: "value", label: "value", type: "number", value: ([name]) => view.merit[name] },
              { key: 1, label: "what it is", wrap: true },
            ],
          }),
        );
    } else
      page.append(
        h(
          "p",
          { class: "soft" },
          "This site has no picture of this problem: ",
          h("code", {}, "fclib view FILE"),
          " draws it.",
        ),
      );
    page.append(...Fclib.computeIt(record, view, id, runs));
    if (runs) {
      const several = new Set(runs.map((r) => r.form)).size > 1;
      page.append(
        h("h2", {}, "Runs"),
        Fclib.table({
          caption: `${runs.length} runs`,
          rows: runs,
          page: 50,
          sort: { key: "cpu_s", down: false },
          columns: [
            { key: "solver", label: "solver", head: true, cell: (r) => solverLink(r.solver) },
            { key: "tol", label: "tolerance", format: Fclib.tolerance },
            ...(several ? [{ key: "form", label: "form" }] : []),
            { key: "status", label: "status", cell: (r) => status(r.status) },
            { key: "error", label: "error", type: "number" },
            { key: "cpu_s", label: "CPU [s]", type: "number" },
            { key: "wall_s", label: "wall [s]", type: "number" },
            { key: "iterations", label: "iterations", type: "number" },
            { key: "memory_mb", label: "memory [MB]", type: "number" },
            {
              key: "message",
              label: "message",
              wrap: runs.some((r) => r.message),
              format: (v) => v || "",
            },
          ],
        }),
      );
      const curves = runs.filter((r) => r.history && r.history.length > 1);
      if (curves.length) {
        const box = h("div", {});
        const tols = [...new Set(curves.map((r) => r.tol))].sort((a, b) => a - b);
        const state = {
          over: params.get("over") || "time",
          tol: Number(params.get("tol") || tols[0]),
        };
        const draw = () => {
          const seen = new Set();
          const own = curves.filter(
            (r) => r.tol === state.tol && !seen.has(r.solver) && seen.add(r.solver),
          );
          const at = state.over === "time" ? 2 : 0;
          const series = own
            .map((r) => {
              const points = r.history
                .filter((p) => p[1] > 0 && p[at] > 0)
                .map((p) => [p[at], p[1]]);
              return {
                name: r.solver,
                style: styleOf(r.solver),
                x: points.map((p) => p[0]),
                y: points.map((p) => p[1]),
              };
            })
            .filter((one) => one.x.length);
          const xs = series.flatMap((one) => one.x);
          const ys = series.flatMap((one) => one.y);
          if (!xs.length) {
            box.replaceChildren();
            return;
          }
          const low = Math.min(...xs);
          const high = Math.max(...xs) > low ? Math.max(...xs) : 2 * low;
          box.replaceChildren(
            Fclib.lines({
              name: `convergence-${id}`,
              title: `Convergence on ${id}, tolerance ${state.tol}`,
              series,
              xlog: true,
              ylog: true,
              xrange: [low, high],
              yrange: [Math.min(...ys) / 2, Math.max(...ys) * 2],
              xname: at ? "time [s]" : "iteration",
              xlabel: at ? "time [s]" : "iteration",
              ylabel: "least error so far",
              note:
                "The error that the solver sees, of the reduced problem; a solver that reports " +
                "once has no curve.",
            }),
          );
        };
        draw();
        page.append(
          h("h2", {}, "Convergence"),
          h(
            "div",
            { class: "controls" },
            select(
              "over",
              [
                ["time", "time"],
                ["iteration", "iterations"],
              ],
              state.over,
              (v) => {
                state.over = v;
                keep({ over: v });
                draw();
              },
            ),
            select(
              "tolerance",
              tols.map((v) => [v, Fclib.tolerance(v)]),
              state.tol,
              (v) => {
                state.tol = Number(v);
                keep({ tol: v });
                draw();
              },
            ),
          ),
          box,
        );
      }
    } else if (s.overview)
      page.append(h("p", { class: "soft" }, "No run of it in the stores of this report."));
    page.append(
      h("h2", {}, "Read it and solve it"),
      ...recipes(row, read).flat(),
      ...Fclib.citeIt("Cite it", Fclib.problemCitation(id, record)),
    );
  };
})();
