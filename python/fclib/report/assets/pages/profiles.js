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
  } = Fclib.parts;

  Fclib.pages.profiles = async (page, rest, params, keep) => {
    const s = site();
    const cat = await catalogue();
    const labels = s.solvers.map((v) => v.label);
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
        select("family", familyChoices(), state.family, change("family")),
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

    let enough = () => fair(state.tol);
    const draw = async () => {
      const [bench, costs] = await Promise.all([
        load(`t${state.tol}`),
        load(`t${state.tol}-${state.metric}`),
      ]);
      const keepProblem = state.family ? (k) => cat.read.family(k) === state.family : () => true;
      const order = [...chosen].sort((a, b) => a - b);
      enough = () =>
        state.family ? Fclib.widest(bench, costs, labels, keepProblem, s.common) : fair(state.tol);
      const found = Fclib.profile(bench, costs, {
        solvers: order,
        keep: keepProblem,
        own: state.set === "own",
        weigh: state.weigh,
        kind: state.kind,
        families: cat.read.family,
        contacts: cat.read.nc,
      });
      drawProfile(order, found, bench);
      drawStatuses(order, bench, keepProblem);
      drawPair(bench, costs, keepProblem);
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
      box.replaceChildren(
        Fclib.lines({
          name: `${state.kind}-${state.metric}-${s.tolerances[state.tol]}`,
          title: `${state.kind} profile, ${metric}, tolerance ${s.tolerances[state.tol]}`,
          series,
          xlog: state.axis === "log",
          xrange: performance
            ? [1, state.axis === "log" ? high * 1.1 : high]
            : [state.axis === "log" ? low * 0.8 : 0, high * 1.1],
          yrange: [0, 1],
          ypercent: true,
          xname: performance ? "τ" : metric,
          xlabel: performance
            ? `τ: ${metric.split(" [")[0]} over that of the best`
            : metric + (state.kind === "contact" ? " per contact" : ""),
          ylabel: performance ? "instances solved within τ" : "instances solved",
          note:
            `${Fclib.count(instances.length, "instance")} of ${bench.problems.length}: ` +
            (state.set === "own"
              ? "for each solver those that it has run and takes"
              : "those that all chosen solvers have run and take") +
            `; ${state.weigh === "families" ? "each family" : "each instance"} weighs the ` +
            `same; ${s.judged}${state.family ? `, family ${state.family}` : ""}.`,
        }),
      );
    };
    const drawStatuses = (order, bench, keepProblem) => {
      const rows = order.map((k) => {
        const counts = Fclib.ended(bench, k, keepProblem);
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
    const drawPair = (bench, costs, keepProblem) => {
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
        if (!keepProblem(k) || absent || (x === null && y === null)) return;
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
