// what several pages have: the catalogue, links, controls, columns
"use strict";
(() => {
  const { h, number, load, link, to } = Fclib;
  const site = () => Fclib.values.site;

  // ---- the catalogue: columns as they are stored, rows when they are asked for
  const catalogue = async () => {
    const stored = await load("catalogue");
    if (stored.rows) return stored;
    const at = (column) =>
      column.words
        ? (k) => (column.values[k] < 0 ? null : column.words[column.values[k]])
        : (k) => column.values[k];
    const read = Object.fromEntries(stored.columns.map((column) => [column.key, at(column)]));
    class Row {
      constructor(k) {
        this.k = k;
      }
    }
    for (const [key, value] of Object.entries(read))
      Object.defineProperty(Row.prototype, key, {
        get() {
          return value(this.k);
        },
      });
    stored.rows = Array.from({ length: stored.size }, (_, k) => new Row(k));
    stored.places = new Map(stored.rows.map((row) => [row.id, row.k]));
    stored.read = read;
    return stored;
  };
  const problemHref = (id) => to("problem", id.split("/"));
  // if there is little room, a name breaks after a part of it
  const problemLink = (id) =>
    h(
      "a",
      { href: problemHref(id) },
      id.split("/").map((part, k) => (k ? ["/", h("wbr"), part] : part)),
    );
  const familyHref = (set, name) => to("family", set ? [set, name] : [name]);
  const solverLink = (label) => (label ? link("solver", [label], {}, label) : "–");

  // ---- controls
  const select = (label, options, value, onchange) =>
    h(
      "label",
      {},
      label,
      h(
        "select",
        { onchange: (e) => onchange(e.target.value) },
        options.map(([key, text]) =>
          h("option", { value: key, selected: String(key) === String(value) }, text),
        ),
      ),
    );
  const tolerances = () => site().tolerances.map((tol, t) => [t, Fclib.tolerance(tol)]);
  const lastTolerance = () => site().tolerances.length - 1;
  // an address may be of another report
  const toleranceOf = (params) => {
    const tol = Number(params.get("tol") ?? lastTolerance());
    return Number.isInteger(tol) && tol >= 0 && tol < lastTolerance() ? tol : lastTolerance();
  };
  const familyChoices = () => [
    ["", "all"],
    ...[...new Set(site().families.map((f) => f.name))].map((name) => [name, name]),
  ];
  const styleOf = (label) => site().solvers.findIndex((solver) => solver.label === label);
  const range = ([a, b]) => (a === b ? number(a) : `${number(a)} to ${number(b)}`);
  const search = (label, value, oninput, hint) =>
    h(
      "label",
      {},
      label,
      h("input", {
        type: "search",
        value: value || "",
        placeholder: hint,
        oninput: (e) => oninput(e.target.value),
      }),
    );
  /* the state of a table, in the address */
  const remembered = (params, keep) => {
    const [sort, down] = (params.get("sort") || "").split(":");
    return {
      sort: sort ? { key: sort, down: down === "down" } : null,
      at: Number(params.get("page") || 1) - 1,
      q: params.get("look") || "",
      onstate: ({ sort: by, at, q }) =>
        keep({ sort: by && `${by.key}${by.down ? ":down" : ""}`, page: at ? at + 1 : "", look: q }),
    };
  };
  const yesOrNumber = (v) => (typeof v === "boolean" ? (v ? "yes" : "no") : number(v));
  const status = (name) =>
    h("span", { class: site().solved.includes(name) ? "good" : "bad" }, name);

  const summaryColumns = (coloured) => [
    {
      key: "solver",
      label: "solver",
      head: true,
      cell: (r) =>
        r.solver === "virtual best"
          ? h("em", { title: "the fastest of all on each instance" }, r.solver)
          : [coloured && Fclib.swatch(styleOf(r.solver)), " ", solverLink(r.solver)],
    },
    {
      key: "method",
      label: "method",
      value: (r) => (site().solvers.find((s) => s.label === r.solver) || {}).family || "",
    },
    {
      key: "solved",
      label: "solved",
      title:
        "instances whose recomputed error meets the tolerance, or of which a proof that " +
        "there is no solution was checked",
    },
    { key: "of", label: "of" },
    {
      key: "share",
      label: "share",
      type: "number",
      title: "of the instances, where each family weighs the same",
      format: Fclib.percent,
    },
    { key: "fastest", label: "fastest", title: "instances on which no other is faster" },
    {
      key: "mean",
      label: "mean [s]",
      type: "number",
      title:
        "shifted geometric mean of the CPU time, each family weighs the same, shift " +
        `${site().charges.shift} s; a failure counts ${site().charges.penalty} times the limit`,
    },
    {
      key: "to best",
      label: "to best",
      type: "number",
      title: "the mean over that of the virtual best solver",
    },
    {
      key: "median ratio",
      label: "median ratio",
      type: "number",
      title: "of the time over that of the best solver, where solved",
    },
    { key: "worst ratio", label: "worst ratio", type: "number" },
  ];

  // ---- what was run, under a chart
  // a published machine has the name of its processor
  const machine = (o) =>
    [...new Set([o.node, o.cpu])].filter(Boolean).join(", ") || "an unknown machine";
  const captionOf = (head) => `${head.caption}; ${site().judged}`;

  Fclib.parts = {
    site,
    catalogue,
    problemHref,
    problemLink,
    familyHref,
    solverLink,
    select,
    tolerances,
    toleranceOf,
    familyChoices,
    styleOf,
    range,
    search,
    remembered,
    yesOrNumber,
    status,
    summaryColumns,
    machine,
    captionOf,
  };
})();
