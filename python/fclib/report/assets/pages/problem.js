// one problem: its picture, facts, runs, files
"use strict";
(() => {
  const { h, number, load, facts, copyable } = Fclib;
  const {
    problemLink,
    range,
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
  const jump = (place) => (event) => {
    event.preventDefault();
    const target = document.getElementById(place);
    target.scrollIntoView();
    const button = target.parentElement.querySelector(`#${place} ~ .copy button`);
    if (button) button.focus({ preventScroll: true });
  };
  /* where there is no picture to turn, the small one */
  const still = (read, row, first) => {
    const place = [row.k, first].find((k) => read.thumb && read.thumb(k));
    return h(
      "figure",
      { class: place === undefined ? "still bare" : "still" },
      place === undefined ? null : h("img", { src: `thumbs/${place}.webp`, alt: "Its bodies" }),
      h(
        "figcaption",
        {},
        "This site has no picture of it to turn: ",
        h("code", {}, "fclib view FILE"),
        " draws it.",
      ),
    );
  };
  const merits = (found) =>
    Fclib.folded(
      "Error of the stored solution, by parts",
      site().docs
        ? h(
            "p",
            { class: "small" },
            h("a", { href: `${site().docs}/mathematics.html` }, "How the error is defined"),
          )
        : "",
      Fclib.table({
        caption: "Recomputed from the file",
        rows: site().merits.filter(([name]) => name in found),
        columns: [
          { key: 0, label: "part", head: true },
          { key: "value", label: "value", type: "number", value: ([name]) => found[name] },
          { key: 1, label: "what it is", wrap: true },
        ],
      }),
    );
  /* the eight facts that are asked for first */
  const keyFacts = (row, view) => {
    const s = site();
    const unknown = (text) => h("span", { class: "soft" }, text);
    const rank = row.rank_W ?? (view && view.spectrum ? view.spectrum.rank : undefined);
    const isAnalysed = Number.isFinite(rank) || row.existence || row.uniqueness;
    return [
      ["contacts", number(row.nc)],
      ["degrees of freedom", row.n === null ? unknown("its bodies are not known") : number(row.n)],
      ["law", s.laws[row.formulation]],
      [
        "μ",
        row.nc
          ? Number.isFinite(row.mu_min)
            ? range([row.mu_min, row.mu_max])
            : unknown("not in the stores")
          : unknown("no contact"),
      ],
      ["class", row.class || unknown("nothing was run")],
      ["solved by", row.solved_of || unknown("nothing was run")],
      ["rank of W", Number.isFinite(rank) ? `${rank} of ${row.rows_W}` : unknown("not analysed")],
      [
        "existence, uniqueness",
        isAnalysed
          ? [
              row.existence || unknown("existence not proven"),
              "; ",
              row.uniqueness ? `velocity ${row.uniqueness}` : unknown("uniqueness not proven"),
            ]
          : unknown("not analysed"),
      ],
    ];
  };
  /* all that the catalogue says */
  const everyFact = (cat, row) => {
    const cells = {
      best_solver: () => solverLink(row.best_solver),
      status: () => status(row.status),
      best_tol: () => Fclib.tolerance(row.best_tol),
      solved_by: () => Fclib.percent(row.solved_by),
      same_as: () => problemLink(row.same_as),
    };
    const known = cat.columns.filter(
      (c) =>
        !c.hidden &&
        !["id", "family", "view", "thumb"].includes(c.key) &&
        row[c.key] !== null &&
        row[c.key] !== undefined,
    );
    const value = (c) => (cells[c.key] || (() => yesOrNumber(row[c.key])))();
    const half = Math.ceil(known.length / 2);
    return Fclib.folded(
      "All facts",
      h(
        "div",
        { class: "two" },
        [known.slice(0, half), known.slice(half)].map((part) =>
          facts(part.map((c) => [c.label, value(c)])),
        ),
      ),
      h(
        "details",
        {},
        h("summary", {}, "What these are"),
        facts(known.filter((c) => c.doc).map((c) => [c.label, c.doc])),
      ),
    );
  };

  Fclib.pages.problem = async (page, rest, params, keep) => {
    const s = site();
    const cat = await catalogue();
    const id = rest.join("/");
    const k = cat.places.get(id);
    if (k === undefined) throw new Fclib.NotHere(`There is no problem ${id} in this catalogue.`);
    const row = cat.rows[k];
    const { read } = cat;
    // runs are stored once for all copies of a problem, and a picture may be
    const first = read.same_as && row.same_as ? cat.places.get(row.same_as) : k;
    const drawn = [k, first].find((place) => read.view && read.view(place));
    const [record, runs, view] = await Promise.all([
      Fclib.fileRecord(k),
      read.runs && row.runs ? load(`problems/${first}`) : null,
      drawn === undefined ? null : load(`views/${drawn}`),
    ]);
    const set = read.collection ? row.collection : "";
    const neighbour = (j, text) =>
      j >= 0 && j < cat.size && read.family(j) === row.family
        ? h("a", { href: problemHref(read.id(j)) }, text)
        : null;
    const ways = [
      neighbour(k - 1, "← previous"),
      h("a", { href: familyHref(set, row.family) }, row.family),
      neighbour(k + 1, "next →"),
      h("a", { href: "#take", onclick: jump("take") }, "Take it"),
      h("a", { href: "#cite", onclick: jump("cite") }, "Cite it"),
    ].filter(Boolean);
    const f = s.families.find((one) => one.name === row.family && one.set === set);
    const steps = f &&
      f.steps && {
        numbers: f.steps,
        count: f.steps.length,
        number: read.number && row.number,
        load: () => load(`sequences/${f.set}/${f.name}`),
        href: (n) => problemHref(`${f.set}/${f.name}/${String(n).padStart(4, "0")}`),
      };
    page.append(
      h("h1", {}, id),
      h(
        "p",
        { class: "small ways" },
        ways.map((a, i) => [i ? " · " : "", a]),
        read.title && row.title && row.title !== id ? ` · ${row.title}` : "",
      ),
      first !== k
        ? h("p", { class: "copied" }, "The same problem as ", problemLink(row.same_as), ".")
        : "",
      Fclib.stage(
        view && view.network ? Fclib.scene(view, id, steps) : still(read, row, first),
        keyFacts(row, view),
      ),
      view && view.network && !view.reactions
        ? h("p", { class: "soft" }, "The file holds no solution; fclib solve --write stores one.")
        : "",
    );
    page.append(...Fclib.computeIt(record, view, id, runs));
    if (runs) {
      const several = (key) => new Set(runs.map((r) => r[key])).size > 1;
      page.append(
        h("h2", {}, "Runs"),
        Fclib.table({
          caption: Fclib.count(runs.length, "run"),
          rows: runs,
          page: 50,
          sort: { key: "cpu_s", down: false },
          columns: [
            { key: "solver", label: "solver", head: true, cell: (r) => solverLink(r.solver) },
            { key: "tol", label: "tolerance", format: Fclib.tolerance },
            ...(several("form") ? [{ key: "form", label: "form" }] : []),
            ...(several("repeat")
              ? [{ key: "repeat", label: "repeat", title: "0: the problem as it is" }]
              : []),
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
          tol: tols.find((tol) => tol === Number(params.get("tol"))) ?? tols[0],
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
    const buildable = Boolean(f && f.parameters && record.files);
    page.append(
      ...Fclib.takeIt(id, record, buildable),
      ...Fclib.citeIt("Cite it", Fclib.problemCitation(id, record)),
      everyFact(cat, row),
      ...(view && view.merit ? [merits(view.merit)] : []),
      ...(view ? Fclib.drawings(view, id) : []),
      Fclib.folded("Read it and solve it", ...recipes(row, read).flat()),
    );
  };
})();
