// which solver for mine: a sentence by the runs of problems like it; and the page of classes and open problems
"use strict";
(() => {
  const { h, number, load, link, to } = Fclib;
  const site = () => Fclib.values.site;
  const select = (label, options, value, onchange) => h("label", {}, label, h("select", { onchange: (e) => onchange(e.target.value) }, options.map(([key, text]) => h("option", { value: key, selected: String(key) === String(value) }, text))));
  const SIZES = [["", "any"], ["0-10", "up to 10"], ["10-50", "10 to 50"], ["50-200", "50 to 200"], ["200-1000", "200 to 1000"], ["1000-", "more than 1000"]];
  /* solvers by the shifted geometric mean of their CPU time, a failure charged `charge` times the limit: those with
     enough runs of such problems, on the instances that all of them have run and take */
  Fclib.ranked = (bench, costs, names, families, keep, charge, { common, weigh, charges: { shift } }) => {
    const solvers = Fclib.widest(bench, costs, names, keep, common), { instances, values } = Fclib.compared(bench, costs, solvers, keep);
    const weights = Fclib.weights(values, instances.map((i) => families(bench.problems[i])), weigh);
    if (!instances.length) return [];
    const charged = instances.map((i) => charge * bench.limits[i]);
    return solvers.map((s, k) => ({ s, ...Fclib.counts(values[k]), mean: Fclib.mean(values[k], weights[k], charged, shift) })).sort((a, b) => a.mean - b.mean);
  };

  Fclib.chooser = (catalogue, params, keep) => {
    const s = site(), state = { kind: params.get("kind") || "", size: params.get("size") || "", ctol: Number(params.get("ctol") ?? s.tolerances.length - 1), weight: Number(params.get("weight") ?? 1) };
    const says = h("p", { role: "status", class: "answer" }, "…"), table = h("div", {});
    const draw = async () => {
      const [cat, bench, costs] = await Promise.all([catalogue(), load(`t${state.ctol}`), load(`t${state.ctol}-cpu_s`)]);
      const { read } = cat, [from, end] = state.size ? state.size.split("-").map((x) => x === "" ? Infinity : Number(x)) : [0, Infinity];
      const like = (k) => (!state.kind || read.kind(k) === state.kind) && read.nc(k) >= from && read.nc(k) <= end;
      const rows = Fclib.ranked(bench, costs, s.solvers.map((one) => one.label), read.family, like, 10 ** state.weight, s);
      const name = (r) => s.solvers[r.s].label, tol = Fclib.tolerance(s.tolerances[state.ctol]);
      if (!rows.length) { says.replaceChildren("No problem like that was run to this tolerance by solvers that compare."); table.replaceChildren(); return; }
      const [best, second] = rows, [low, high] = Fclib.odds(best.solved, best.of);
      says.replaceChildren("Take ", h("b", {}, link("solver", [name(best)], {}, name(best))), `. It solved ${best.solved} of ${best.of} such problems to ${tol}, and should solve the next one with a chance of ${Math.round(100 * low)} to ${Math.round(100 * high)} %. Its mean CPU time is ${number(best.mean)} s, where a failure counts as ${number(10 ** state.weight)} times the limit.`,
        ...second ? [" The second is ", link("solver", [name(second)], {}, name(second)), `: ${second.solved} of ${second.of}, ${number(second.mean)} s.`] : [], ` All were compared on the same ${best.of} instances, and each family weighs the same: `, h("a", { href: to("profiles", [], { tol: state.ctol }) }, "the curves"), ".");
      table.replaceChildren(h("details", {}, h("summary", {}, "All solvers by this weight"), Fclib.table({
        caption: "Solvers with enough runs of such problems, the best first; a failure is charged so many times the limit as the weight says", rows, page: 20, sort: { key: "mean", down: false },
        columns: [{ key: "solver", label: "solver", head: true, value: name, cell: (r) => link("solver", [name(r)], {}, name(r)) }, { key: "solved", label: "solved" }, { key: "failed", label: "failed", type: "number", value: (r) => r.of - r.solved }, { key: "mean", label: "mean [s]", type: "number" }],
      })));
    };
    const change = (key) => (value) => { state[key] = ["ctol", "weight"].includes(key) ? Number(value) : value; keep({ [key]: value }); draw(); };
    const weight = h("label", {}, "speed … certainty", h("input", { type: "range", min: 0, max: 4, step: 0.5, value: state.weight, "aria-label": "Weight of certainty against speed", onchange: (e) => change("weight")(e.target.value) }));
    const kinds = h("span", {});
    catalogue().then((cat) => {
      const values = cat.read.kind ? [...new Set(cat.rows.map((row) => row.kind).filter(Boolean))].sort() : [];
      if (values.length > 1) kinds.replaceWith(select("kind", [["", "any"], ...values.map((v) => [v, v])], state.kind, change("kind")));
      draw();
    });
    return h("section", { class: "panel" }, h("h2", {}, "Which solver for mine?"), h("div", { class: "controls" }, kinds, select("contacts", SIZES, state.size, change("size")), select("tolerance", s.tolerances.map((tol, t) => [t, Fclib.tolerance(tol)]), state.ctol, change("ctol")), weight), says, table);
  };

  // ---- classes, and what is open
  Fclib.pages.classes = async (page) => {
    const s = site(), list = s.ratings || [];
    page.append(h("h1", {}, "Easy, hard and open"), h("p", {}, "A problem is easy if more than half of the solvers that take it solve it, and hard if fewer do. It is open if no solver has solved it, and nobody else's solution is within the tolerance."));
    if (!list.length) page.append(h("p", {}, "No stored runs came with this report: they are in the package fclib-collection."));
    for (const one of list) {
      page.append(h("h2", {}, one.set), h("p", { class: "small" }, `Classes ${one.basis}.`));
      if (one.open.length) page.append(Fclib.table({
        caption: `Open problems of ${one.set}: the best error known, and by whom`, rows: one.open, page: 50,
        columns: [{ key: "problem", label: "problem", head: true, cell: (r) => s.known && s.known.includes(r.problem) ? h("a", { href: to("problem", r.problem.split("/")) }, r.problem) : r.problem }, { key: "error", label: "best error", type: "number" }, { key: "by", label: "by", wrap: true }, { key: "date", label: "date" }],
      }), h("p", {}, "Better one of them:"), Fclib.copyable(`fclib collection status ${one.open[0].problem} --out open.hdf5      # the problem, with the best solution known\nfclib check open.hdf5                                 # its error, as it will be judged\nfclib collection take yours.hdf5 --by "you, and how"  # taken where it is better by a tenth`, "the commands"));
      page.append(Fclib.table({
        caption: `Classes of ${one.set}, by family`, rows: one.families, page: 60,
        columns: [{ key: "family", label: "family", head: true }, { key: "easy", label: "easy" }, { key: "hard", label: "hard" }, { key: "open", label: "open" }],
      }));
    }
  };
})();
