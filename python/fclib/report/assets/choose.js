// which solver for mine: a sentence by the runs of problems like it
"use strict";
(() => {
  const { h, number, load } = Fclib;
  const { site, catalogue, select, solverLink, tolerances, toleranceOf } = Fclib.parts;
  const SIZES = [
    ["", "any"],
    ["0-10", "up to 10"],
    ["10-50", "10 to 50"],
    ["50-200", "50 to 200"],
    ["200-1000", "200 to 1000"],
    ["1000-", "more than 1000"],
  ];
  /* solvers by the shifted geometric mean of their CPU time, a failure charged `charge` times the
     limit: those with enough runs of such problems, on the instances that all of them have run and
     take */
  Fclib.ranked = (
    bench,
    costs,
    names,
    families,
    keep,
    charge,
    { common, weigh, charges: { shift } },
  ) => {
    const solvers = Fclib.widest(bench, costs, names, keep, common);
    const { instances, values } = Fclib.compared(bench, costs, solvers, keep);
    const weights = Fclib.weights(
      values,
      instances.map((i) => families(bench.problems[i])),
      weigh,
    );
    if (!instances.length) return [];
    const charged = instances.map((i) => charge * bench.limits[i]);
    return solvers
      .map((s, k) => ({
        s,
        ...Fclib.counts(values[k]),
        mean: Fclib.mean(values[k], weights[k], charged, shift),
      }))
      .sort((a, b) => a.mean - b.mean);
  };

  /* the same of all problems, as Python has summed it; null if it has not */
  const stored = (t, charge) => {
    const s = site();
    const head = s.headlines[t];
    if (!head || charge !== s.charges.penalty) return null;
    const places = new Map(s.solvers.map((one, k) => [one.label, k]));
    return head.tables[""]
      .filter((row) => places.has(row.solver))
      .map((row) => ({ ...row, s: places.get(row.solver) }))
      .sort((a, b) => a.mean - b.mean);
  };

  /* which problems are meant: of a set, of a kind, of a size */
  const meant = ({ set, kind, size }, { read }) => {
    const [from, end] = size
      ? size.split("-").map((x) => (x === "" ? Infinity : Number(x)))
      : [0, Infinity];
    return (k) =>
      (!set || read.collection(k) === set) &&
      (!kind || read.kind(k) === kind) &&
      read.nc(k) >= from &&
      read.nc(k) <= end;
  };
  const answer = (rows, state) => {
    const s = site();
    const name = (r) => s.solvers[r.s].label;
    const [best, second] = rows;
    const [low, high] = Fclib.odds(best.solved, best.of);
    const charge = number(10 ** state.weight);
    return [
      "Take ",
      h("b", {}, solverLink(name(best))),
      `. It solved ${best.solved} of ${Fclib.count(best.of, "such problem")} to ` +
        `${Fclib.tolerance(s.tolerances[state.tol])}, and should solve the next one with a ` +
        `chance of ${Math.round(100 * low)} to ${Math.round(100 * high)} %. Its mean CPU time ` +
        `is ${number(best.mean)} s, where a failure counts ` +
        `${charge === "1" ? "as" : `${charge} times`} the limit.`,
      ...(second && second.solved > 0
        ? [
            " The second is ",
            solverLink(name(second)),
            `: ${second.solved} of ${second.of}, ${number(second.mean)} s.`,
          ]
        : []),
    ];
  };
  const everyRank = (rows) => {
    const name = (r) => site().solvers[r.s].label;
    const box = h("details", {}, h("summary", {}, "All solvers by this weight"));
    const table = () =>
      Fclib.table({
        caption:
          "Solvers with enough runs of such problems, the best first; a failure is " +
          "charged so many times the limit as the weight says",
        rows,
        page: 20,
        sort: { key: "mean", down: false },
        columns: [
          {
            key: "solver",
            label: "solver",
            head: true,
            value: name,
            cell: (r) => solverLink(name(r)),
          },
          { key: "solved", label: "solved" },
          { key: "failed", label: "failed", type: "number", value: (r) => r.of - r.solved },
          { key: "mean", label: "mean [s]", type: "number" },
        ],
      });
    box.addEventListener("toggle", () => box.children.length > 1 || box.append(table()));
    return box;
  };

  /* the panel; changed({tol, narrowed, like, cat, bench, costs}) hears which problems are meant */
  Fclib.chooser = (params, keep, changed) => {
    const s = site();
    const state = {
      set: params.get("set") || "",
      kind: params.get("kind") || "",
      size: params.get("size") || "",
      tol: toleranceOf(params),
      weight: Number(params.get("weight") ?? 1),
    };
    const says = h("p", { role: "status", class: "answer" }, "…");
    const table = h("div", {});
    let turn = 0;
    const draw = async () => {
      const own = ++turn;
      const narrowed = Boolean(state.set || state.kind || state.size);
      const charge = 10 ** state.weight;
      let rows = narrowed ? null : stored(state.tol, charge);
      let found = { tol: state.tol, narrowed };
      if (!rows) {
        const [cat, bench, costs] = await Promise.all([
          catalogue(),
          load(`t${state.tol}`),
          load(`t${state.tol}-cpu_s`),
        ]);
        if (own !== turn) return;
        const like = meant(state, cat);
        const names = s.solvers.map((one) => one.label);
        rows = Fclib.ranked(bench, costs, names, cat.read.family, like, charge, s);
        found = { ...found, like, cat, bench, costs };
      }
      says.replaceChildren(
        ...(rows.length
          ? answer(rows, state)
          : ["No problem like that was run to this tolerance by solvers that compare."]),
      );
      table.replaceChildren(...(rows.length ? [everyRank(rows)] : []));
      changed(found);
    };
    const change = (key) => (value) => {
      state[key] = ["tol", "weight"].includes(key) ? Number(value) : value;
      keep({ [key]: value });
      return draw();
    };
    const weight = h(
      "label",
      {},
      "speed … certainty",
      h("input", {
        type: "range",
        min: 0,
        max: 4,
        step: 0.5,
        value: state.weight,
        "aria-label": "Weight of certainty against speed",
        onchange: (e) => change("weight")(e.target.value),
      }),
    );
    const [sets, kinds] = [h("span", {}), h("span", {})];
    const fill = (place, label, key, values) => {
      const there = [...new Set(values.filter(Boolean))].sort();
      if (there.length < 2) {
        place.remove();
        return;
      }
      const choices = [["", "any"], ...there.map((value) => [value, value])];
      place.replaceWith(select(label, choices, state[key], change(key)));
    };
    catalogue().then((cat) => {
      const all = (key) => (cat.read[key] ? cat.rows.map((row) => row[key]) : []);
      fill(sets, "set", "set", all("collection"));
      fill(kinds, "kind", "kind", all("kind"));
    });
    draw();
    return h(
      "section",
      { class: "panel" },
      h("h2", {}, "Which solver for mine?"),
      h(
        "div",
        { class: "controls" },
        sets,
        kinds,
        select("contacts", SIZES, state.size, change("size")),
        select("tolerance", tolerances(), state.tol, change("tol")),
        weight,
      ),
      says,
      table,
    );
  };
})();
