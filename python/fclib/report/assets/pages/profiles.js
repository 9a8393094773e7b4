// curves of any choice of solvers, measures and problems; two solvers problem by problem
"use strict";
(() => {
  const { h, load } = Fclib;
  const {
    site,
    catalogue,
    problemHref,
    solverLink,
    select,
    tolerances,
    toleranceOf,
    familyChoices,
    machine,
  } = Fclib.parts;

  const SET = "set:"; // before the name of a set
  const TITLES = {
    performance: "Performance profiles",
    data: "Data profiles",
    contact: "Data profiles of the cost per contact",
  };

  Fclib.pages.profiles = async (page, rest, params, keep) => {
    const s = site();
    const cat = await catalogue();
    const labels = s.solvers.map((v) => v.label);
    const setChoices = () => Object.keys(s.sets).map((name) => [SET + name, `set ${name}`]);
    const fair = (t) =>
      ((s.headlines[t] || {}).solvers || labels).map((name) => labels.indexOf(name));
    const state = {
      tol: toleranceOf(params),
      metric: params.get("metric") || "cpu_s",
      kind: params.get("kind") || "performance",
      family: params.get("family") || "",
      axis: params.get("axis") || "log",
      set: params.get("set") || "common",
      weigh: params.get("weigh") || s.weigh,
      solvers: params.get("solvers")
        ? params
            .get("solvers")
            .split("~")
            .map((name) => labels.indexOf(name))
            .filter((k) => k >= 0)
        : null,
      a: params.get("a"),
      b: params.get("b"),
    };
    let chosen = new Set(state.solvers || fair(state.tol));
    const box = h("div", {});
    const pair = h("div", {});
    const statuses = h("div", {});
    const change = (key) => (value) => {
      state[key] = key === "tol" ? Number(value) : value;
      keep({ [key]: value });
      return draw();
    };
    const chips = h("div", { class: "choices", role: "group", "aria-label": "Solvers" });
    const fill = () =>
      chips.replaceChildren(
        ...labels.map((name, k) =>
          h(
            "label",
            {},
            h("input", {
              type: "checkbox",
              checked: chosen.has(k),
              onchange: (e) => {
                if (e.target.checked) chosen.add(k);
                else chosen.delete(k);
                kept();
              },
            }),
            Fclib.swatch(k),
            name,
          ),
        ),
      );
    const kept = () => {
      keep({ solvers: labels.filter((_, k) => chosen.has(k)).join("~") });
      return draw();
    };
    const choose = (text, which) =>
      h(
        "button",
        {
          type: "button",
          onclick: () => {
            chosen = new Set(which());
            fill();
            kept();
          },
        },
        text,
      );
    fill();
    page.append(
      h("h1", {}, "Profiles"),
      h(
        "div",
        { class: "controls" },
        select(
          "profile",
          [
            ["performance", "performance: ratio to the best"],
            ["data", "data: cost"],
            ["contact", "data: cost per contact"],
          ],
          state.kind,
          change("kind"),
        ),
        select("measure", Object.entries(s.metrics), state.metric, change("metric")),
        select("tolerance", tolerances(), state.tol, change("tol")),
        select("problems", [...setChoices(), ...familyChoices()], state.family, change("family")),
        select(
          "set",
          [
            ["common", "common: what all of them have run and take"],
            ["own", "own: what each has run and takes"],
          ],
          state.set,
          change("set"),
        ),
        select(
          "weight",
          [
            ["families", "all families alike"],
            ["instances", "all instances alike"],
          ],
          state.weigh,
          change("weigh"),
        ),
        select(
          "axis",
          [
            ["log", "logarithmic"],
            ["linear", "linear"],
          ],
          state.axis,
          change("axis"),
        ),
      ),
      chips,
      h(
        "div",
        { class: "tools" },
        choose("those with enough runs", () => enough()),
        choose("all", () => labels.map((_, k) => k)),
        choose("none", () => []),
      ),
      box,
      h("h2", {}, "How they ended"),
      statuses,
      h("h2", {}, "Two solvers, problem by problem"),
      pair,
    );

    // a report without a catalogue knows no sets
    const setOf = (k) =>
      [cat.read.collection?.(k), cat.read.kind?.(k)].find((name) => s.sets[name]) ?? "";
    const isMeant = (k) =>
      !state.family ||
      state.family === (state.family.startsWith(SET) ? SET + setOf(k) : cat.read.family(k));
    let enough = () => fair(state.tol);
    const draw = async () => {
      const [bench, costs] = await Promise.all([
        load(`t${state.tol}`),
        load(`t${state.tol}-${state.metric}`),
      ]);
      const order = [...chosen].sort((a, b) => a - b);
      enough = () =>
        state.family ? Fclib.widest(bench, costs, labels, isMeant, s.common) : fair(state.tol);
      const found = Fclib.profile(bench, costs, {
        solvers: order,
        keep: isMeant,
        own: state.set === "own",
        weigh: state.weigh,
        kind: state.kind,
        families: cat.read.family,
        contacts: cat.read.nc,
      });
      drawProfile(order, found, bench);
      drawStatuses(order, bench);
      drawPair(bench, costs);
    };
    const drawProfile = (order, { instances, values, shown, weights }, bench) => {
      if (!order.length || !instances.length) {
        box.replaceChildren(
          h(
            "p",
            { class: "panel" },
            order.length
              ? "There is no instance that all of these solvers have run and take."
              : "Choose some solvers.",
          ),
        );
        return;
      }
      const performance = state.kind === "performance";
      let low = Infinity;
      let high = -Infinity;
      for (const own of shown)
        for (const v of own)
          if (Number.isFinite(v)) {
            if (v < low) low = v;
            if (v > high) high = v;
          }
      if (low === Infinity) {
        box.replaceChildren(
          h("p", { class: "panel" }, "None of these solvers solves any of these instances."),
        );
        return;
      }
      if (performance) {
        low = 1;
        high = Math.max(2, Math.min(1e4, high));
        if (state.axis === "linear") high = Math.min(high, 20);
      }
      if (high <= low) high = low * 2;
      const series = order.map((k, i) => ({
        name: labels[k],
        legend: Fclib.legend(labels[k], values[i]),
        style: k,
        ...Fclib.shares(
          shown[i],
          weights[i],
          performance ? 1 : state.axis === "log" ? low * 0.8 : 0,
        ),
      }));
      const metric = s.metrics[state.metric];
      const axes = {
        name: `${state.kind}-${state.metric}-${s.tolerances[state.tol]}`,
        series,
        xlog: state.axis === "log",
        xrange: performance
          ? [1, state.axis === "log" ? high * 1.1 : high]
          : [state.axis === "log" ? low * 0.8 : 0, high * 1.1],
        xlabel: performance
          ? `τ: ${metric.split(" [")[0]} over that of the best`
          : metric + (state.kind === "contact" ? " per contact" : ""),
      };
      const of =
        state.set === "own"
          ? "for each solver those that it has run and takes"
          : "those that all chosen solvers have run and take";
      const weight = state.weigh === "families" ? "each family" : "each instance";
      const problems = state.family.replace(SET, "set ");
      box.replaceChildren(
        Fclib.lines({
          ...axes,
          title: `${state.kind} profile, ${metric}, tolerance ${s.tolerances[state.tol]}`,
          yrange: [0, 1],
          ypercent: true,
          xname: performance ? "τ" : metric,
          ylabel: performance ? "instances solved within τ" : "instances solved",
          note:
            `${Fclib.count(instances.length, "instance")} of ${bench.problems.length}: ${of}` +
            `; ${weight} weighs the same; ${s.judged}` +
            `${problems && `, ${state.family.startsWith(SET) ? "" : "family "}${problems}`}.`,
        }),
        Fclib.paper(
          {
            ...axes,
            colours: s.colours,
            ylabel: performance ? "share solved within τ" : "share solved",
          },
          caption(order, instances, values, bench, [of, `${weight} weighs the same`]),
        ),
      );
    };
    /* what a figure of these is of, and what it cites */
    const caption = (order, instances, values, bench, words) => {
      const rows = instances.map((i) => bench.problems[i]);
      const limits = instances.map((i) => bench.limits[i]);
      const ends = [Math.min(...limits), Math.max(...limits)];
      const failed = values.flat().filter((v) => v === Infinity).length;
      const had = values.flat().filter((v) => !Number.isNaN(v)).length;
      const solvers = order.map((k) => s.solvers[k]);
      const sets = [...new Set(rows.map(setOf))].filter(Boolean).sort();
      const families = new Set(rows.map((k) => cat.read.family(k)));
      return {
        title: TITLES[state.kind],
        words: [
          `${Fclib.count(instances.length, "instance")} of ` +
            Fclib.count(families.size, "family", "families"),
          ...words,
          `tolerance ${Fclib.tolerance(s.tolerances[state.tol])}`,
          `limit ${[...new Set(ends)].map((v) => Fclib.number(v)).join(" to ")} s of CPU`,
          `${failed} of ${Fclib.count(had, "run")} failed`,
          s.judged,
          machine(s.overview),
          `FCLIB ${s.version}`,
        ],
        cites: [
          ...solvers.map((one) => [one.label, one.cite]),
          ...sets.map((name) => [
            `set ${name}, version ${s.sets[name].version}`,
            [s.sets[name].bibtex],
          ]),
          ["FCLIB", s.cite.collection.split("\n\n")],
        ],
      };
    };
    const drawStatuses = (order, bench) => {
      const rows = order.map((k) => {
        const counts = Fclib.ended(bench, k, isMeant);
        const total = Object.values(counts).reduce((a, b) => a + b, 0);
        return { solver: labels[k], total, counts };
      });
      const there = s.statuses.filter(([code]) => rows.some((row) => row.counts[code]));
      statuses.replaceChildren(
        Fclib.table({
          caption: "Instances, by the status of the run; over all that each solver has run",
          rows,
          page: 60,
          largest: true,
          columns: [
            { key: "solver", label: "solver", head: true, cell: (r) => solverLink(r.solver) },
            { key: "total", label: "runs" },
            ...there.map(([code, name, meaning]) => ({
              key: code,
              label: name,
              title: meaning,
              type: "number",
              value: (r) => r.counts[code] || 0,
            })),
          ],
        }),
      );
    };
    /* auto and the one that does best beside it: by problems solved, then by the mean */
    const rivals = (t, all) => {
      const table = ((s.headlines[t] || { tables: {} }).tables[""] || [])
        .filter((r) => r.solver !== "virtual best")
        .map((r) => r.solver);
      const order = [...table, ...all.filter((name) => !table.includes(name))];
      const first = order.includes("auto") ? "auto" : order[0];
      return [first, order.find((name) => name !== first) ?? first];
    };
    const drawPair = (bench, costs) => {
      const names = labels.map((name) => [name, name]);
      const [first_, second_] = rivals(state.tol, labels);
      const a = Math.max(0, labels.indexOf(state.a ?? first_));
      const b = Math.max(0, labels.indexOf(state.b ?? second_));
      const families = [...new Set(bench.problems.map((k) => cat.read.family(k)))].sort();
      const points = [];
      let first = 0;
      let second = 0;
      let low = Infinity;
      let high = 0;
      bench.problems.forEach((k, i) => {
        const x = costs[a][i];
        const y = costs[b][i];
        const absent = [a, b].some((one) => bench.absent.includes(bench.statuses[one][i]));
        if (!isMeant(k) || absent || (x === null && y === null)) return;
        for (const v of [x, y])
          if (v !== null) {
            low = Math.min(low, v);
            high = Math.max(high, v);
          }
        if (y === null || (x !== null && x < y)) first++;
        else if (x === null || y < x) second++;
        const id = cat.read.id(k);
        points.push({ x, y, problem: id, group: families.indexOf(cat.read.family(k)) });
      });
      const metric = s.metrics[state.metric];
      pair.replaceChildren(
        h(
          "div",
          { class: "controls" },
          select("across", names, labels[a], change("a")),
          select("up", names, labels[b], change("b")),
        ),
        points.length
          ? Fclib.scatter({
              name: `${labels[a]}-${labels[b]}`,
              title: `${labels[a]} against ${labels[b]}, ${metric}`,
              points,
              groups: families,
              range: [low * 0.8, high * 1.25],
              xlabel: `${labels[a]}: ${metric}`,
              ylabel: `${labels[b]}: ${metric}`,
              xname: labels[a],
              yname: labels[b],
              to: problemHref,
              note:
                `${Fclib.count(points.length, "instance")} that at least one of the two ` +
                `solves (${s.judged}); ` +
                `${labels[a]} needs less on ${first}, ${labels[b]} on ${second}. Each point ` +
                "leads to its problem.",
            })
          : h("p", { class: "panel" }, "No instance that both have run and take, and one solves."),
      );
    };
    await draw();
  };
})();
