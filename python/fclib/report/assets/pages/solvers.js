// all solvers, and one of them
"use strict";
(() => {
  const { h, number, link, facts, prose, copyable } = Fclib;
  const { site, catalogue, problemLink, solverLink, summaryColumns } = Fclib.parts;

  Fclib.pages.solvers = async (page) => {
    const s = site();
    page.append(
      h("h1", {}, "Solvers"),
      Fclib.table({
        caption: `${Fclib.count(s.solvers.length, "solver")}${s.overview ? " that were run" : ""}`,
        rows: s.solvers,
        page: 100,
        columns: [
          { key: "label", label: "solver", head: true, cell: (r) => solverLink(r.label) },
          { key: "family", label: "method", format: (v) => v || "" },
          { key: "origin", label: "from", format: (v) => v || "" },
          { key: "title", label: "what it is", format: (v) => v || "", wrap: true },
          { key: "version", label: "version", format: (v) => v || "" },
        ],
      }),
    );
  };
  Fclib.pages.solver = async (page, rest) => {
    const s = site();
    const label = rest.join("/");
    const solver =
      s.solvers.find((one) => one.label === label) || s.solvers.find((one) => one.name === label);
    if (!solver)
      throw new Fclib.NotHere(
        `There is no solver ${label} in this report. ` +
          `It has ${s.solvers.map((one) => one.label).join(", ")}.`,
      );
    const cat = await catalogue();
    const set = solver.options && solver.options !== "{}" ? solver.options : null;
    page.append(
      h("h1", {}, solver.label),
      solver.title ? h("p", {}, solver.title) : "",
      facts([
        ["name", solver.name],
        ["options set", set && h("code", {}, set)],
        ["method", solver.family],
        ["from", [solver.origin, solver.version].filter(Boolean).join(" ")],
        ["citation", solver.citation],
        [
          "takes",
          solver.dimensions &&
            [
              ...solver.dimensions.map((d) => `${d}D`),
              ...(solver.rolling || []).map((d) => `${d === 3 ? "planar" : "spatial"} rolling`),
              ...(solver.spin || []).map((d) => (d === 4 ? "spin" : "spin and rolling")),
            ].join(", "),
        ],
      ]),
    );
    s.headlines.forEach((head, t) => {
      if (!head || !head.tables[""].some((r) => r.solver === solver.label)) return;
      const rows = Object.entries(head.tables).map(([family, table]) => ({
        family,
        ...table.find((r) => r.solver === solver.label),
      }));
      const columns = summaryColumns().filter((c) => !["solver", "method"].includes(c.key));
      page.append(
        h("h2", {}, `At tolerance ${Fclib.tolerance(s.tolerances[t])}`),
        Fclib.table({
          caption: `By family, to ${Fclib.tolerance(s.tolerances[t])}`,
          rows,
          columns: [
            {
              key: "family",
              label: "family",
              head: true,
              cell: (r) =>
                r.family ? link("profiles", [], { tol: t, family: r.family }, r.family) : "all",
            },
            ...columns,
          ],
        }),
      );
      const { best, worst } = head.extremes[solver.label];
      const list = (caption, entries) =>
        Fclib.table({
          caption,
          rows: entries,
          columns: [
            {
              key: 0,
              label: "problem",
              type: "text",
              head: true,
              cell: (e) => problemLink(cat.read.id(e[0])),
            },
            {
              key: "ratio",
              label: "ratio",
              type: "number",
              value: (e) => (e[1] === null || e[2] === null ? null : e[1] / e[2]),
              format: (v) => (v === null ? "–" : number(v)),
            },
            {
              key: 1,
              label: "CPU [s]",
              type: "number",
              format: (v) => (v === null ? h("span", { class: "bad" }, "failed") : number(v)),
            },
            {
              key: 2,
              label: "best other [s]",
              type: "number",
              format: (v) => (v === null ? "none solves it" : number(v)),
            },
            { key: 3, label: "which is", type: "text", wrap: true, cell: (e) => solverLink(e[3]) },
          ],
        });
      page.append(
        h(
          "div",
          { class: "two" },
          best.length
            ? list(`Where it is best, to ${Fclib.tolerance(s.tolerances[t])}`, best)
            : h("p", {}, "It is nowhere the fastest."),
          worst.length
            ? list(`Where it is worst, to ${Fclib.tolerance(s.tolerances[t])}`, worst)
            : h("p", {}, "It is the fastest everywhere."),
        ),
      );
    });
    if (solver.known)
      page.append(
        h("h2", {}, "Options"),
        solver.known.length
          ? Fclib.table({
              caption: "Set by name=value",
              rows: solver.known,
              page: 60,
              columns: [
                { key: 0, label: "option", head: true },
                { key: 1, label: "type", wrap: true },
                { key: 2, label: "default", type: "text" },
                { key: 3, label: "unit" },
                { key: 4, label: "meaning", wrap: true, cell: (r) => prose(r[4]) },
              ],
            })
          : h("p", {}, "It has none."),
      );
    page.append(
      ...Fclib.citeIt(
        "Cite it",
        [...(solver.papers || []).map((one) => one.bibtex), solver.bibtex].join("\n\n"),
        solver.papers || [],
      ),
    );
    page.append(h("h2", {}, "Use it"), ...solver.use.map((line) => copyable(line)));
  };
})();
