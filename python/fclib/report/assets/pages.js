// the pages
"use strict";
(() => {
  const { h, number, load, link, to, facts, prose } = Fclib;
  const site = () => Fclib.values.site;

  // ---- the catalogue: columns as they are stored, rows when they are asked for
  const catalogue = async () => {
    const stored = await load("catalogue");
    if (stored.rows) return stored;
    const at = (column) => column.words ? (k) => column.values[k] < 0 ? null : column.words[column.values[k]] : (k) => column.values[k];
    const read = Object.fromEntries(stored.columns.map((column) => [column.key, at(column)]));
    class Row { constructor(k) { this.k = k; } }
    for (const [key, value] of Object.entries(read)) Object.defineProperty(Row.prototype, key, { get() { return value(this.k); } });
    stored.rows = Array.from({ length: stored.size }, (_, k) => new Row(k));
    stored.places = new Map(stored.rows.map((row) => [row.id, row.k]));
    stored.read = read;
    return stored;
  };
  const problemHref = (id) => to("problem", id.split("/"));
  // where there is little room, a name breaks after a part of it
  const problemLink = (id) => h("a", { href: problemHref(id) }, id.split("/").map((part, k) => k ? ["/", h("wbr"), part] : part));
  const familyHref = (set, name) => to("family", set ? [set, name] : [name]);
  const solverLink = (label) => label ? link("solver", [label], {}, label) : "–";

  // ---- controls
  const select = (label, options, value, onchange) => h("label", {}, label, h("select", { onchange: (e) => onchange(e.target.value) },
    options.map(([key, text]) => h("option", { value: key, selected: String(key) === String(value) }, text))));
  const tolerances = () => site().tolerances.map((tol, t) => [t, Fclib.tolerance(tol)]);
  const lastTolerance = () => site().tolerances.length - 1;
  const families = () => [["", "all"], ...[...new Set(site().families.map((f) => f.name))].map((name) => [name, name])];
  const styleOf = (label) => site().solvers.findIndex((solver) => solver.label === label);
  const range = ([a, b]) => a === b ? number(a) : `${number(a)} to ${number(b)}`;
  const search = (label, value, oninput, hint) => h("label", {}, label, h("input", { type: "search", value: value || "", placeholder: hint, oninput: (e) => oninput(e.target.value) }));
  /* the state of a table, in the address */
  const remembered = (params, keep) => {
    const [sort, down] = (params.get("sort") || "").split(":");
    return {
      sort: sort ? { key: sort, down: down === "down" } : null, at: Number(params.get("page") || 1) - 1, q: params.get("look") || "",
      onstate: ({ sort: by, at, q }) => keep({ sort: by && `${by.key}${by.down ? ":down" : ""}`, page: at ? at + 1 : "", look: q }),
    };
  };
  const { copyable } = Fclib;
  const shown = (v) => typeof v === "boolean" ? v ? "yes" : "no" : number(v);
  const status = (name) => h("span", { class: site().solved.includes(name) ? "good" : "bad" }, name);

  const summaryColumns = (coloured) => [
    { key: "solver", label: "solver", head: true, cell: (r) => r.solver === "virtual best" ? h("em", { title: "the fastest of all on each instance" }, r.solver) : [coloured && Fclib.swatch(styleOf(r.solver)), " ", solverLink(r.solver)] },
    { key: "method", label: "method", value: (r) => (site().solvers.find((s) => s.label === r.solver) || {}).family || "" },
    { key: "solved", label: "solved", title: "instances whose recomputed error meets the tolerance, or of which a proof that there is no solution was checked" },
    { key: "of", label: "of" },
    { key: "share", label: "share", type: "number", title: "of the instances, where each family weighs the same", format: Fclib.percent },
    { key: "fastest", label: "fastest", title: "instances on which no other is faster" },
    { key: "mean", label: "mean [s]", type: "number", title: `shifted geometric mean of the CPU time, each family weighs the same, shift ${site().charges.shift} s; a failure counts ${site().charges.penalty} times the limit` },
    { key: "to best", label: "to best", type: "number", title: "the mean over that of the virtual best solver" },
    { key: "median ratio", label: "median ratio", type: "number", title: "of the time over that of the best solver, where solved" },
    { key: "worst ratio", label: "worst ratio", type: "number" },
  ];

  // ---- what was run, under a chart
  const machine = (o) => [o.node, o.cpu].filter(Boolean).join(", ") || "an unknown machine";
  const caption = (head) => `${head.caption}; ${site().judged}`;

  // ---- overview
  Fclib.pages.overview = async (page, rest, params, keep) => {
    const s = site(), o = s.overview;
    page.append(h("h1", {}, s.title));
    if (!o) {
      page.append(h("p", {}, `${s.problems} problems in ${s.families.length} families. No runs were given to this report.`));
    } else {
      page.append(h("p", {}, `${s.solvers.length} solvers on ${o.problems} problems${s.problems > o.problems ? ` of ${s.problems} in the catalogue` : ""}. Every error is recomputed from the problem and the returned solution: `,
        h("em", {}, "solved"), ` means that the relative error meets the tolerance within the limits, or that a proof that there is no solution was checked; ${s.judged}. Solvers are compared on the instances that all of them have run and take, and each family weighs the same.`),
      h("ul", { class: "figures" }, [[s.problems, "problems"], [s.families.length, "families"], [s.solvers.length, "solvers"], [o.runs, "runs"], [Fclib.percent(o.share), "of them solved"]].map(([value, name]) =>
        h("li", {}, h("b", {}, value.toLocaleString("en").replaceAll(",", " ")), h("span", {}, name)))));
      page.append(Fclib.chooser(catalogue, params, keep));
      page.append(h("h2", {}, "Performance profiles"), h("p", {}, "What share of the instances a solver has solved within a multiple τ of the CPU time of the best solver on each. At the left: how often it is the fastest. At the right: how often it succeeds at all."));
      const charts = h("div", { class: "two" });
      s.headlines.forEach((head, t) => {
        if (!head) return;
        const shown = head.order.map((k) => ({ name: head.solvers[k], legend: head.legend[k], x: head.taus, y: head.curves[k], style: styleOf(head.solvers[k]), band: head.bands && [head.bands[0][k], head.bands[1][k]] }));
        charts.append(h("section", {}, h("h3", {}, `Tolerance ${Fclib.tolerance(s.tolerances[t])}`),
          Fclib.lines({
            half: true, name: `profile-${s.tolerances[t]}`, title: `Performance profile at ${s.tolerances[t]}`, series: shown.slice(0, 12), xlog: true, xrange: [1, head.taus[head.taus.length - 1]], yrange: [0, 1],
            ypercent: true, xlabel: "τ: CPU time over that of the best", ylabel: "instances solved within τ", xname: "τ",
            note: `${caption(head)}${head.bands ? "; bands: 95 % by drawing families and problems anew" : ""}${head.not_compared.length ? `; not compared, having run or taking too few of them: ${head.not_compared.map((r) => `${r.solver} (${r.solved} of ${r.of})`).join(", ")}` : ""}${shown.length > 12 ? `; the best 12 of ${shown.length} solvers` : ""}.`,
          }), h("p", {}, link("profiles", [], { tol: t }, "Look closer: choose families, solvers, measures"))));
      });
      page.append(charts);
      if (s.tolerances.length > 1 && s.work && s.work.length) page.append(h("h2", {}, "What an accuracy costs"), Fclib.work({
        name: "work-precision", title: "CPU time by tolerance", rows: s.work, style: styleOf, xlabel: "CPU time in the mean [s]",
        note: `Shifted geometric means over the instances that all have run and take at a tolerance, each family weighs the same, a failure charged ${s.charges.penalty} times the limit; ${machine(o)}.`,
      }));
      page.append(h("h2", {}, "Solvers"));
      const state = { tol: Number(params.get("tol") ?? lastTolerance()), family: params.get("family") || "" };
      const rows = () => ((s.headlines[state.tol] || { tables: {} }).tables[state.family]) || [];
      const table = Fclib.table({ caption: "CPU times of the solvers, over the instances that all of them have run and take; the virtual best is the fastest of all on each", columns: summaryColumns(true), rows: rows(), page: 60, search: true, ...remembered(params, keep) });
      const change = (key) => (value) => { state[key] = key === "tol" ? Number(value) : value; keep({ [key]: value }); table.update(rows()); };
      page.append(h("div", { class: "controls" }, select("tolerance", tolerances(), state.tol, change("tol")),
        select("family", families(), state.family, change("family"))), table);
      if (o.along.length) page.append(h("h2", {}, "Along sequences"), h("p", {}, "Each solver solved consecutive problems from its own solution of the step before (warm), and from nothing (cold). All else on these pages is of the cold runs."), Fclib.table({
        caption: "Warm runs beside cold runs of the same steps", rows: o.along, page: 60,
        columns: ["sequence", "solver", "tol", "cold CPU / warm CPU", "iterations warm", "iterations cold", "solved warm", "solved cold", "of", "drift"].map((key) => ({ key, label: key, head: key === "sequence" })),
      }));
      page.append(h("h2", {}, "How the runs ended"), Fclib.table({
        caption: "Statuses of all runs", rows: Object.entries(o.statuses).map(([name, v]) => ({ name, ...v })),
        columns: [{ key: "name", label: "status", head: true, cell: (r) => status(r.name) }, { key: "count", label: "runs" }, { key: "share", label: "share", type: "number", format: Fclib.percent }, { key: "meaning", label: "meaning", wrap: true }],
      }), h("h2", {}, "Where and what"), facts([["machine", `${o.node || "?"}, ${o.cpu || "?"}`], ["campaigns", o.campaigns.map((c) => `${c.name}: ${c.done} of ${c.planned} runs${c.ended ? "" : ", not ended"}`).join("; ")]]));
    }
    page.append(h("h2", {}, "Families"), familyCards(s.families));
  };

  const familyCards = (list) => h("div", { class: "cards" }, list.map((f) => h("article", { class: "panel" },
    f.scene || f.thumb ? h("a", { href: familyHref(f.set, f.name), tabindex: -1, "aria-hidden": "true" }, h("img", { src: f.scene || f.thumb, alt: "", loading: "lazy" })) : null,
    h("h3", {}, h("a", { href: familyHref(f.set, f.name) }, f.title || f.name)),
    h("p", { class: "small" }, f.description || ""),
    h("p", { class: "small soft" }, `${f.problems} problem${f.problems === 1 ? "" : "s"}, ${f.ranges.nc ? range(f.ranges.nc) : "?"} contacts, ${f.formulations.join(", ")}`))));

  Fclib.pages.families = async (page) => {
    const { families: all, problems } = site(), sets = [...new Set(all.map((f) => f.set))];
    page.append(h("h1", {}, "Families"), h("p", {}, `${problems} problems in ${all.length} families${sets.length > 1 ? ` of ${sets.length} sets` : ""}.`),
      ...sets.flatMap((set) => [h("h2", {}, set || "Of no set"), familyCards(all.filter((f) => f.set === set))]).filter(Boolean));
  };

  // ---- profiles
  Fclib.pages.profiles = async (page, rest, params, keep) => {
    const s = site(), cat = await catalogue();
    const labels = s.solvers.map((v) => v.label);
    const fair = (t) => ((s.headlines[t] || {}).solvers || labels).map((name) => labels.indexOf(name));
    const t0 = Math.min(lastTolerance(), Number(params.get("tol") ?? lastTolerance()));
    const state = {
      tol: t0, metric: params.get("metric") || "cpu_s", kind: params.get("kind") || "performance", family: params.get("family") || "", axis: params.get("axis") || "log",
      set: params.get("set") || "common", weigh: params.get("weigh") || s.weigh,
      solvers: params.get("solvers") ? params.get("solvers").split("~").map((name) => labels.indexOf(name)).filter((k) => k >= 0) : null,
      a: params.get("a"), b: params.get("b"),
    };
    let chosen = new Set(state.solvers || fair(state.tol));
    const box = h("div", {}), pair = h("div", {}), statuses = h("div", {});
    const change = (key) => (value) => {
      state[key] = key === "tol" ? Number(value) : value;
      keep({ [key]: value });
      return draw();
    };
    const chips = h("div", { class: "choices", role: "group", "aria-label": "Solvers" });
    const fill = () => chips.replaceChildren(...labels.map((name, k) => h("label", {}, h("input", { type: "checkbox", checked: chosen.has(k), onchange: (e) => { if (e.target.checked) chosen.add(k); else chosen.delete(k); kept(); } }), Fclib.swatch(k), name)));
    const kept = () => { keep({ solvers: labels.filter((_, k) => chosen.has(k)).join("~") }); return draw(); };
    const choose = (text, which) => h("button", { type: "button", onclick: () => { chosen = new Set(which()); fill(); kept(); } }, text);
    fill();
    page.append(h("h1", {}, "Profiles"), h("div", { class: "controls" },
      select("profile", [["performance", "performance: ratio to the best"], ["data", "data: cost"], ["contact", "data: cost per contact"]], state.kind, change("kind")),
      select("measure", Object.entries(s.metrics), state.metric, change("metric")), select("tolerance", tolerances(), state.tol, change("tol")),
      select("family", families(), state.family, change("family")),
      select("set", [["common", "common: what all of them have run and take"], ["own", "own: what each has run and takes"]], state.set, change("set")),
      select("weight", [["families", "all families alike"], ["instances", "all instances alike"]], state.weigh, change("weigh")),
      select("axis", [["log", "logarithmic"], ["linear", "linear"]], state.axis, change("axis"))),
    chips, h("div", { class: "tools" }, choose("those with enough runs", () => enough()), choose("all", () => labels.map((_, k) => k)), choose("none", () => [])),
    box, h("h2", {}, "How they ended"), statuses, h("h2", {}, "Two solvers, problem by problem"), pair);

    let enough = () => fair(state.tol);
    const draw = async () => {
      const [bench, costs] = await Promise.all([load(`t${state.tol}`), load(`t${state.tol}-${state.metric}`)]);
      const keepProblem = state.family ? (k) => cat.read.family(k) === state.family : () => true;
      const order = [...chosen].sort((a, b) => a - b);
      enough = () => (state.family ? Fclib.widest(bench, costs, labels, keepProblem, s.common) : fair(state.tol));
      const found = Fclib.profile(bench, costs, { solvers: order, keep: keepProblem, own: state.set === "own", weigh: state.weigh, kind: state.kind, families: cat.read.family, contacts: cat.read.nc });
      drawProfile(order, found, bench);
      drawStatuses(order, bench, keepProblem);
      drawPair(bench, costs, keepProblem);
    };
    const drawProfile = (order, { instances, values, shown, weights }, bench) => {
      if (!order.length || !instances.length) { box.replaceChildren(h("p", { class: "panel" }, order.length ? "There is no instance that all of these solvers have run and take." : "Choose some solvers.")); return; }
      const performance = state.kind === "performance";
      let low = Infinity, high = -Infinity;
      for (const own of shown) for (const v of own) if (Number.isFinite(v)) { if (v < low) low = v; if (v > high) high = v; }
      if (low === Infinity) { box.replaceChildren(h("p", { class: "panel" }, "None of these solvers solves any of these instances.")); return; }
      if (performance) { low = 1; high = Math.max(2, Math.min(1e4, high)); if (state.axis === "linear") high = Math.min(high, 20); }
      if (high <= low) high = low * 2;
      const series = order.map((k, i) => ({ name: labels[k], legend: Fclib.legend(labels[k], values[i]), style: k, ...Fclib.shares(shown[i], weights[i], performance ? 1 : state.axis === "log" ? low * 0.8 : 0) }));
      const metric = s.metrics[state.metric];
      box.replaceChildren(Fclib.lines({
        name: `${state.kind}-${state.metric}-${s.tolerances[state.tol]}`, title: `${state.kind} profile, ${metric}, tolerance ${s.tolerances[state.tol]}`, series, xlog: state.axis === "log",
        xrange: performance ? [1, state.axis === "log" ? high * 1.1 : high] : [state.axis === "log" ? low * 0.8 : 0, high * 1.1], yrange: [0, 1], ypercent: true, xname: performance ? "τ" : metric,
        xlabel: performance ? `τ: ${metric.split(" [")[0]} over that of the best` : metric + (state.kind === "contact" ? " per contact" : ""), ylabel: performance ? "instances solved within τ" : "instances solved",
        note: `${instances.length} instances of ${bench.problems.length}: ${state.set === "own" ? "for each solver those that it has run and takes" : "those that all chosen solvers have run and take"}; ${state.weigh === "families" ? "each family" : "each instance"} weighs the same; ${s.judged}${state.family ? `, family ${state.family}` : ""}.`,
      }));
    };
    const drawStatuses = (order, bench, keepProblem) => {
      const rows = order.map((k) => {
        const counts = Fclib.ended(bench, k, keepProblem), total = Object.values(counts).reduce((a, b) => a + b, 0);
        return { solver: labels[k], total, counts };
      });
      const there = s.statuses.filter(([code]) => rows.some((row) => row.counts[code]));
      statuses.replaceChildren(Fclib.table({
        caption: "Instances, by the status of the run; over all that each solver has run", rows, page: 60, largest: true,
        columns: [{ key: "solver", label: "solver", head: true, cell: (r) => solverLink(r.solver) }, { key: "total", label: "runs" },
          ...there.map(([code, name, meaning]) => ({ key: code, label: name, title: meaning, type: "number", value: (r) => r.counts[code] || 0 }))],
      }));
    };
    /* auto and the one that does best beside it: by problems solved, then by the mean */
    const rivals = (t, all) => {
      const table = (((s.headlines[t] || { tables: {} }).tables)[""] || []).filter((r) => r.solver !== "virtual best").map((r) => r.solver);
      const order = [...table, ...all.filter((name) => !table.includes(name))], first = order.includes("auto") ? "auto" : order[0];
      return [first, order.find((name) => name !== first) ?? first];
    };
    const drawPair = (bench, costs, keepProblem) => {
      const names = labels.map((name) => [name, name]);
      const [first_, second_] = rivals(state.tol, labels);
      const a = Math.max(0, labels.indexOf(state.a ?? first_)), b = Math.max(0, labels.indexOf(state.b ?? second_));
      const families = [...new Set(bench.problems.map((k) => cat.read.family(k)))].sort();
      const points = [];
      let first = 0, second = 0, low = Infinity, high = 0;
      bench.problems.forEach((k, i) => {
        const x = costs[a][i], y = costs[b][i], absent = [a, b].some((one) => bench.absent.includes(bench.statuses[one][i]));
        if (!keepProblem(k) || absent || (x === null && y === null)) return;
        for (const v of [x, y]) if (v !== null) { low = Math.min(low, v); high = Math.max(high, v); }
        if (y === null || (x !== null && x < y)) first++; else if (x === null || y < x) second++;
        const id = cat.read.id(k);
        points.push({ x, y, problem: id, group: families.indexOf(cat.read.family(k)) });
      });
      const metric = s.metrics[state.metric];
      pair.replaceChildren(h("div", { class: "controls" }, select("across", names, labels[a], change("a")), select("up", names, labels[b], change("b"))),
        points.length ? Fclib.scatter({
          name: `${labels[a]}-${labels[b]}`, title: `${labels[a]} against ${labels[b]}, ${metric}`, points, groups: families, range: [low * 0.8, high * 1.25], xlabel: `${labels[a]}: ${metric}`, ylabel: `${labels[b]}: ${metric}`, xname: labels[a], yname: labels[b], to: problemHref,
          note: `${points.length} instances that at least one of the two solves (${s.judged}); ${labels[a]} needs less on ${first}, ${labels[b]} on ${second}. Each point leads to its problem.`,
        }) : h("p", { class: "panel" }, "No instance that both have run and take, and one solves."));
    };
    await draw();
  };

  // ---- catalogue
  // a row may have several tags of a kind
  const many = (v) => v === null || v === undefined || v === "" ? [] : String(v).split(", ");
  const TAGS = [["kind", "kind"], ["class", "class"], ["formulation", "form"], ["application", "application"], ["status", "reference"], ["collection", "set"]];
  const SLIDERS = ["nc", "n", "p", "density", "mu_max", "solved_by", "conditioning_W", "best_s"];
  /* two handles over the values of a column, by their ranks, so that each step tells some problems apart */
  const slider = (column, values, state, change) => {
    const steps = [...new Set(values)].sort((a, b) => a - b);
    if (steps.length < 2) return null;
    const last = steps.length - 1, said = h("span", {});
    const at = (key, missing) => { const v = state[key]; if (v === "") return missing; const k = steps.findIndex((x) => x >= Number(v)); return k < 0 ? last : key.endsWith("-") && steps[k] > Number(v) && k ? k - 1 : k; };
    const handle = (key, missing, name) => h("input", { type: "range", min: 0, max: last, step: 1, value: at(key, missing), "aria-label": `${column.label} ${name}` });
    const from = handle(`${column.key}+`, 0, "from"), to = handle(`${column.key}-`, last, "to");
    const tell = () => { said.textContent = `${column.label} ${number(steps[from.value])} to ${number(steps[to.value])}`; };
    from.addEventListener("input", () => { if (Number(from.value) > Number(to.value)) to.value = from.value; tell(); change(`${column.key}+`, Number(from.value) ? String(steps[from.value]) : ""); change(`${column.key}-`, Number(to.value) < last ? String(steps[to.value]) : ""); });
    to.addEventListener("input", () => { if (Number(to.value) < Number(from.value)) from.value = to.value; tell(); change(`${column.key}+`, Number(from.value) ? String(steps[from.value]) : ""); change(`${column.key}-`, Number(to.value) < last ? String(steps[to.value]) : ""); });
    tell();
    return h("div", { class: "range" }, said, from, to);
  };

  Fclib.pages.catalogue = async (page, rest, params, keep) => {
    const cat = await catalogue(), { read } = cat, shownColumns = cat.columns.filter((c) => !c.hidden && c.key !== "thumb");
    const tags = TAGS.filter(([key]) => read[key]).map(([key, label]) => [key, label, [...new Set(cat.rows.flatMap((row) => many(row[key])))].sort()]).filter(([, , values]) => values.length > 1);
    const sliders = SLIDERS.map((key) => cat.columns.find((c) => c.key === key)).filter(Boolean);
    const keys = ["q", "family", "runs", ...tags.map(([key]) => key), ...sliders.flatMap((c) => [`${c.key}+`, `${c.key}-`])];
    const state = Object.fromEntries(keys.map((key) => [key, params.get(key) || ""]));
    const chosen = (key) => new Set(state[key] ? state[key].split("~") : []);
    // names, titles and what the family says: where a plain word is looked for
    const about = new Map(site().families.map((f) => [f.name, [f.title, f.description, f.application, f.kind].join(" ").toLowerCase()]));
    const memory = new Map();
    const words = (k) => {
      if (!memory.has(k)) memory.set(k, `${[read.id(k), read.title && read.title(k), ...TAGS.map(([key]) => read[key] && read[key](k)), about.get(read.family(k))].filter(Boolean).join(" ")}`.toLowerCase());
      return memory.get(k);
    };
    // there before they are asked for
    (window.requestIdleCallback || setTimeout)(() => { for (let k = 0; k < cat.size; k++) words(k); });
    const says = h("p", { class: "small", role: "status" });
    let listed = [];
    const rows = () => {
      let parsed;
      try { parsed = Fclib.parseFilter(state.q, { columns: shownColumns, read, words }); } catch (error) {
        says.className = "small bad";
        says.textContent = `The filter is not understood: ${error.message}. ${listed.length ? "The list is as it was before." : "Nothing is listed."}`;
        return listed;
      }
      const limits = sliders.flatMap(({ key }) => [[`${key}+`, (v, x) => v >= x], [`${key}-`, (v, x) => v <= x]].filter(([name]) => state[name] !== "").map(([name, within]) => (k) => { const v = read[key](k); return v !== null && v !== undefined && within(v, Number(state[name])); }));
      const sets = tags.map(([key]) => [key, chosen(key)]).filter(([, own]) => own.size).map(([key, own]) => (k) => many(read[key](k)).some((tag) => own.has(tag)));
      const tests = [parsed.test, ...limits, ...sets, ...state.family ? [(k) => read.family(k) === state.family] : [], ...state.runs ? [(k) => read.runs(k)] : []];
      listed = cat.rows.filter(({ k }) => tests.every((test) => test(k)));
      const lost = listed.length ? [] : parsed.parts.filter((part) => !cat.rows.some(({ k }) => part.test(k))).map((part) => part.text);
      says.className = "small soft";
      says.textContent = `${listed.length} of ${cat.size} problems${lost.length ? `; no problem at all has: ${lost.join(", ")}` : ""}`;
      return listed;
    };
    const format = { view: (v) => v ? "yes" : "", slater: shown, best_tol: (v) => v ? Fclib.tolerance(v) : "–", solved_by: (v) => v === null ? "–" : Fclib.percent(v) };
    const picture = (row) => read.thumb && row.thumb ? h("img", { class: "thumb", src: `thumbs/${row.k}.webp`, alt: "", loading: "lazy", width: 64, height: 48 }) : null;
    const columns = shownColumns.map((c) => ({
      key: c.key, label: c.label, title: c.doc, head: c.key === "id", format: format[c.key],
      type: c.words || ["id", "family", "formulation", "status", "best_solver", "view", "kind", "class", "application"].includes(c.key) ? "text" : "number",
      cell: c.key === "id" ? (row) => h("span", { class: "named" }, picture(row), problemLink(row.id))
        : c.key === "family" ? (row) => h("a", { href: familyHref(read.collection ? row.collection : "", row.family) }, row.family)
          : c.key === "best_solver" ? (row) => solverLink(row.best_solver) : c.key === "status" ? (row) => row.status ? status(row.status) : "–" : undefined,
    }));
    const table = Fclib.table({ caption: "Problems", name: "catalogue", columns, rows: rows(), page: 25, search: false, ...remembered(params, keep) });
    let waiting = 0;
    const update = (changes) => {
      Object.assign(state, changes);
      clearTimeout(waiting);
      waiting = setTimeout(() => { keep({ ...state, page: "" }); table.update(rows()); }, 30);
    };
    const change = (key) => (value) => update({ [key]: value === true ? "1" : value || "" });
    const chips = ([key, label, values]) => h("fieldset", { class: "choices" }, h("legend", {}, label), values.map((value) => h("label", {}, h("input", { type: "checkbox", checked: chosen(key).has(String(value)), onchange: (e) => {
      const own = chosen(key);
      if (e.target.checked) own.add(String(value)); else own.delete(String(value));
      update({ [key]: [...own].join("~") });
    } }), String(value))));
    const values = (key) => [["", "all"], ...[...new Set(cat.rows.map((row) => row[key]))].sort().map((v) => [v, v])];
    const narrowed = keys.some((key) => key !== "q" && key !== "family" && key !== "runs" && state[key]);
    page.append(h("h1", {}, "Catalogue"),
      h("div", { class: "controls" }, search("filter", state.q, change("q"), "masonry contacts>50 class=hard"), select("family", values("family"), state.family, change("family")),
        read.runs && h("label", { class: "check" }, h("input", { type: "checkbox", checked: Boolean(state.runs), onchange: (e) => change("runs")(e.target.checked) }), "with runs")),
      says,
      h("details", { open: narrowed || !Fclib.isNarrow() }, h("summary", {}, "Narrow it down"), h("div", { class: "ranges" }, sliders.map((c) => slider(c, cat.rows.map((row) => row[c.key]).filter((v) => typeof v === "number"), state, (key, value) => update({ [key]: value })))), tags.map(chips)),
      table,
      h("details", {}, h("summary", {}, "What the columns are"), facts(shownColumns.map((c) => [c.label, [c.doc, c.doc && " ", h("code", {}, c.key)]]))),
      h("details", {}, h("summary", {}, "What the filter understands"),
        h("p", { class: "small" }, "A word is looked for in names, titles, kinds, classes, applications and the descriptions of families. A condition is a column, a sign and a value, in this order. A column has its label or its name, and the signs are = != < > <= >=. A blank between two words or conditions means ", h("code", {}, "and"), ". You can also write ", h("code", {}, "or"), ", ", h("code", {}, "not"), " and brackets. Put a text with blanks into \"quotes\"."),
        h("ul", { class: "small" }, ["contacts > 100 and μ max < 0.5", "masonry (class = hard or class = open)", "form != G3DFC", "best solver = nsgs", "\"tower of\" not rt444", "solved by < 50%"].map((text) => h("li", {}, h("a", { href: to("catalogue", [], { q: text }) }, h("code", {}, text))))),
        h("p", { class: "small" }, "The address of this page keeps the filter.")));
    says.after(Fclib.selection(() => listed));
  };

  // ---- a family
  Fclib.pages.family = async (page, rest, params) => {
    const s = site(), name = rest[rest.length - 1], set = rest.length > 1 ? rest[0] : "";
    const f = s.families.find((one) => one.name === name && (one.set || "") === set) || s.families.find((one) => one.name === name);
    if (!f) throw new Fclib.NotHere(`There is no family ${rest.join("/")}.`);
    page.append(h("h1", {}, f.title || f.name),
      h("div", { class: "two" }, f.scene || f.thumb ? h("figure", {}, h("img", { src: f.scene || f.thumb, alt: f.description || f.name })) : null,
        h("div", {}, h("p", {}, f.description || ""), (f.text || []).map((text) => h("p", { class: "small" }, prose(text))),
          facts([["name", f.set ? `${f.set}/${f.name}` : f.name], ["problems", link("catalogue", [], { family: f.name }, String(f.problems))], ["application", f.application], ["friction", f.friction], ["original by", f.authors], ["formulations", f.formulations.join(", ")],
            ...Object.entries(f.ranges).map(([key, ends]) => [{ nc: "contacts", n: "degrees of freedom", density: "density", mu_max: "μ" }[key], range(ends)])]))));
    if (s.docs) page.append(h("p", {}, h("a", { href: `${s.docs}/families/${f.name}.html` }, "This family in the documentation")));
    if (f.distribution) page.append(h("h2", {}, "Distribution"), h("figure", {}, h("img", { src: f.distribution, alt: `Histograms of contacts, degrees of freedom and density: ${f.problems} problems` }), h("figcaption", {}, "The numbers are in the ", link("catalogue", [], { family: f.name }, "catalogue"), ".")));
    if (s.headlines.some((head) => head && head.tables[f.name])) {
      const t = Number(params.get("tol") ?? lastTolerance()), head = s.headlines[t];
      page.append(h("h2", {}, "Solvers on this family"), h("p", {}, s.tolerances.map((tol, k) => [k ? " · " : "", k === t ? h("b", {}, `tolerance ${Fclib.tolerance(tol)}`) : link("family", rest, { tol: k }, `tolerance ${Fclib.tolerance(tol)}`)]), " · ", link("profiles", [], { family: f.name, tol: t }, "profiles")));
      if (head && head.tables[f.name]) page.append(Fclib.table({ caption: `CPU times on ${f.name}`, columns: summaryColumns(), rows: head.tables[f.name], page: 60 }));
    }
    if (f.parameters) page.append(h("h2", {}, "Parameters of the scene"), Fclib.table({
      caption: "As in the collection", rows: f.parameters, page: 60,
      columns: [{ key: 0, label: "parameter", head: true }, { key: 1, label: "default", type: "text" }, { key: 2, label: "unit" }, { key: 3, label: "meaning", wrap: true }],
    }), h("h2", {}, "Take it"), copyable(`fclib collection build ${f.set ? `${f.set}/` : ""}${f.name} --out collection`, "the command"));
    page.append(...Fclib.citeIt("Cite it", f.bibtex), h("p", { class: "small" }, f.citation ? `The data: ${f.citation}.` : ""));
  };

  // ---- a problem
  const recipes = (row, read) => {
    const file = (read.global_file && row.global_file) || (read.local_file && row.local_file), name = row.id.split("/").pop();
    const built = file && site().families.some((f) => f.name === row.family && f.parameters), own = site().recipes[row.formulation];
    const filled = (text) => text.replaceAll("{path}", file ? `collection/${file}` : `${name}.hdf5`).replaceAll("{id}", row.id).replaceAll("{family}", row.family);
    return [["Command line", built ? own.build : own.shell], ["Python", built ? own.load : own.python], ["C", own.c], ["h5py, SciPy and MATLAB", own.h5py]].map(([title, text]) => [h("h3", {}, title), copyable(filled(text))]);
  };
  Fclib.pages.problem = async (page, rest, params, keep) => {
    const s = site(), cat = await catalogue(), id = rest.join("/"), k = cat.places.get(id);
    if (k === undefined) throw new Fclib.NotHere(`There is no problem ${id} in this catalogue.`);
    const row = cat.rows[k], { read } = cat;
    const [record, runs, view] = await Promise.all([Fclib.fileRecord(k), read.runs && row.runs ? load(`problems/${k}`) : null, read.view && row.view ? load(`views/${k}`) : null]);
    const neighbour = (j, text) => j >= 0 && j < cat.size && read.family(j) === row.family ? h("a", { href: problemHref(read.id(j)) }, text) : null;
    page.append(h("h1", {}, id), h("p", { class: "small" }, [neighbour(k - 1, "← previous"), h("a", { href: familyHref(read.collection ? row.collection : "", row.family) }, row.family), neighbour(k + 1, "next →")].filter(Boolean).map((a, i) => [i ? " · " : "", a])),
      read.title && row.title && row.title !== id && h("p", {}, row.title));
    const labelled = cat.columns.filter((c) => !c.hidden && !["id", "family", "view", "thumb"].includes(c.key)).map((c) => [c.label, row[c.key] === null || row[c.key] === undefined ? null : c.key === "best_solver" ? solverLink(row.best_solver) : c.key === "status" ? status(row.status) : c.key === "best_tol" ? Fclib.tolerance(row.best_tol) : c.key === "solved_by" ? Fclib.percent(row.solved_by) : shown(row[c.key])]);
    const half = Math.ceil(labelled.length / 2);
    const docs = cat.columns.filter((c) => !c.hidden && c.doc && row[c.key] !== null && row[c.key] !== undefined).map((c) => [c.label, c.doc]);
    page.append(h("div", { class: "panel" }, h("div", { class: "two" }, facts(labelled.slice(0, half)), facts(labelled.slice(half))), h("details", {}, h("summary", {}, "What these are"), facts(docs))));
    const buildable = s.families.some((f) => f.name === row.family && f.parameters && f.set === (read.collection ? row.collection : ""));
    page.append(...Fclib.takeIt(id, record, buildable && Boolean(record.files)), h("p", { class: "small" }, h("a", { href: "#cite", onclick: (e) => { e.preventDefault(); document.getElementById("cite").scrollIntoView(); document.querySelector("#cite + .copy button").focus({ preventScroll: true }); } }, "Cite it")));
    if (view) {
      const f = s.families.find((one) => one.name === row.family && one.set === (read.collection ? row.collection : "")), own = read.number && row.number;
      const steps = f && f.steps && { numbers: f.steps, count: f.steps.length, number: own, load: () => load(`sequences/${f.set}/${f.name}`), href: (n) => problemHref(`${f.set}/${f.name}/${String(n).padStart(4, "0")}`) };
      page.append(...Fclib.pictures(view, id, steps));
      if (view.merit) page.append(h("h2", {}, "Merit of the reference solution"), s.docs ? h("p", { class: "small" }, h("a", { href: `${s.docs}/mathematics.html` }, "How the error is defined")) : "", Fclib.table({
        caption: "Recomputed from the file", rows: s.merits.filter(([name]) => name in view.merit),
        columns: [{ key: 0, label: "part", head: true }, { key: "value", label: "value", type: "number", value: ([name]) => view.merit[name] }, { key: 1, label: "what it is", wrap: true }],
      }));
    } else page.append(h("p", { class: "soft" }, "This site has no picture of this problem: ", h("code", {}, "fclib view FILE"), " draws it."));
    page.append(...Fclib.computeIt(record, view, id, runs));
    if (runs) {
      const several = new Set(runs.map((r) => r.form)).size > 1;
      page.append(h("h2", {}, "Runs"), Fclib.table({
        caption: `${runs.length} runs`, rows: runs, page: 50, sort: { key: "cpu_s", down: false },
        columns: [{ key: "solver", label: "solver", head: true, cell: (r) => solverLink(r.solver) }, { key: "tol", label: "tolerance", format: Fclib.tolerance }, ...several ? [{ key: "form", label: "form" }] : [], { key: "status", label: "status", cell: (r) => status(r.status) },
          { key: "error", label: "error", type: "number" }, { key: "cpu_s", label: "CPU [s]", type: "number" }, { key: "wall_s", label: "wall [s]", type: "number" }, { key: "iterations", label: "iterations", type: "number" }, { key: "memory_mb", label: "memory [MB]", type: "number" }, { key: "message", label: "message", wrap: runs.some((r) => r.message), format: (v) => v || "" }],
      }));
      const curves = runs.filter((r) => r.history && r.history.length > 1);
      if (curves.length) {
        const box = h("div", {}), tols = [...new Set(curves.map((r) => r.tol))].sort((a, b) => a - b);
        const state = { over: params.get("over") || "time", tol: Number(params.get("tol") || tols[0]) };
        const draw = () => {
          const seen = new Set();
          const own = curves.filter((r) => r.tol === state.tol && !seen.has(r.solver) && seen.add(r.solver));
          const at = state.over === "time" ? 2 : 0;
          const series = own.map((r) => {
            const points = r.history.filter((p) => p[1] > 0 && p[at] > 0).map((p) => [p[at], p[1]]);
            return { name: r.solver, style: styleOf(r.solver), x: points.map((p) => p[0]), y: points.map((p) => p[1]) };
          }).filter((one) => one.x.length);
          const xs = series.flatMap((one) => one.x), ys = series.flatMap((one) => one.y);
          if (!xs.length) { box.replaceChildren(); return; }
          let [low, high] = [Math.min(...xs), Math.max(...xs)];
          if (low === high) high = 2 * low;
          box.replaceChildren(Fclib.lines({
            name: `convergence-${id}`, title: `Convergence on ${id}, tolerance ${state.tol}`, series, xlog: true, ylog: true, xrange: [low, high], yrange: [Math.min(...ys) / 2, Math.max(...ys) * 2],
            xname: at ? "time [s]" : "iteration", xlabel: at ? "time [s]" : "iteration", ylabel: "least error so far", note: "The error that the solver sees, of the reduced problem; a solver that reports once has no curve.",
          }));
        };
        draw();
        page.append(h("h2", {}, "Convergence"), h("div", { class: "controls" }, select("over", [["time", "time"], ["iteration", "iterations"]], state.over, (v) => { state.over = v; keep({ over: v }); draw(); }), select("tolerance", tols.map((v) => [v, Fclib.tolerance(v)]), state.tol, (v) => { state.tol = Number(v); keep({ tol: v }); draw(); })), box);
      }
    } else if (s.overview) page.append(h("p", { class: "soft" }, "No run of it in the stores of this report."));
    page.append(h("h2", {}, "Read it and solve it"), ...recipes(row, read).flat(), ...Fclib.citeIt("Cite it", Fclib.problemCitation(id, record)));
  };

  // ---- solvers
  Fclib.pages.solvers = async (page) => {
    const s = site();
    page.append(h("h1", {}, "Solvers"), Fclib.table({
      caption: `${s.solvers.length} solvers${s.overview ? " that were run" : ""}`, rows: s.solvers, page: 100,
      columns: [{ key: "label", label: "solver", head: true, cell: (r) => solverLink(r.label) }, { key: "family", label: "method", format: (v) => v || "" }, { key: "origin", label: "from", format: (v) => v || "" }, { key: "title", label: "what it is", format: (v) => v || "", wrap: true }, { key: "version", label: "version", format: (v) => v || "" }],
    }));
  };
  Fclib.pages.solver = async (page, rest) => {
    const s = site(), label = rest.join("/"), solver = s.solvers.find((one) => one.label === label) || s.solvers.find((one) => one.name === label);
    if (!solver) throw new Fclib.NotHere(`There is no solver ${label} in this report.`);
    const cat = await catalogue();
    const set = solver.options && solver.options !== "{}" ? solver.options : null;
    page.append(h("h1", {}, solver.label), solver.title && h("p", {}, solver.title), facts([["name", solver.name], ["options set", set && h("code", {}, set)], ["method", solver.family], ["from", [solver.origin, solver.version].filter(Boolean).join(" ")], ["citation", solver.citation],
      ["takes", solver.dimensions && [...solver.dimensions.map((d) => `${d}D`), ...(solver.rolling || []).map((d) => `${d === 3 ? "planar" : "spatial"} rolling`)].join(", ")]]));
    s.headlines.forEach((head, t) => {
      if (!head || !head.tables[""].some((r) => r.solver === solver.label)) return;
      const rows = Object.entries(head.tables).map(([family, table]) => ({ family, ...table.find((r) => r.solver === solver.label) }));
      const columns = summaryColumns().filter((c) => !["solver", "method"].includes(c.key));
      page.append(h("h2", {}, `At tolerance ${Fclib.tolerance(s.tolerances[t])}`), Fclib.table({ caption: `By family, to ${Fclib.tolerance(s.tolerances[t])}`, rows, columns: [{ key: "family", label: "family", head: true, cell: (r) => r.family ? link("profiles", [], { tol: t, family: r.family }, r.family) : "all" }, ...columns] }));
      const { best, worst } = head.extremes[solver.label];
      const list = (caption, entries) => Fclib.table({
        caption, rows: entries, columns: [
          { key: 0, label: "problem", type: "text", head: true, cell: (e) => problemLink(cat.read.id(e[0])) },
          { key: "ratio", label: "ratio", type: "number", value: (e) => e[1] === null || e[2] === null ? null : e[1] / e[2], format: (v) => v === null ? "–" : number(v) },
          { key: 1, label: "CPU [s]", type: "number", format: (v) => v === null ? h("span", { class: "bad" }, "failed") : number(v) },
          { key: 2, label: "best other [s]", type: "number", format: (v) => v === null ? "none solves it" : number(v) }, { key: 3, label: "which is", type: "text", wrap: true, cell: (e) => solverLink(e[3]) }],
      });
      page.append(h("div", { class: "two" }, best.length ? list(`Where it is best, to ${Fclib.tolerance(s.tolerances[t])}`, best) : h("p", {}, "It is nowhere the fastest."), worst.length ? list(`Where it is worst, to ${Fclib.tolerance(s.tolerances[t])}`, worst) : h("p", {}, "It is the fastest everywhere.")));
    });
    if (solver.known) page.append(h("h2", {}, "Options"), solver.known.length ? Fclib.table({
      caption: "Set by name=value", rows: solver.known, page: 60,
      columns: [{ key: 0, label: "option", head: true }, { key: 1, label: "type", wrap: true }, { key: 2, label: "default", type: "text" }, { key: 3, label: "unit" }, { key: 4, label: "meaning", wrap: true, cell: (r) => prose(r[4]) }],
    }) : h("p", {}, "It has none."));
    page.append(...Fclib.citeIt("Cite it", [...(solver.papers || []).map((one) => one.bibtex), solver.bibtex].join("\n\n"), solver.papers || []));
    page.append(h("h2", {}, "Use it"), copyable(`fclib solve --solver ${solver.name} FILE`), copyable(`result = fclib.solve(problem, solver="${solver.name}", tol=1e-8)`));
  };

  // ---- what the site is made with
  Fclib.pages.about = async (page) => {
    page.append(h("h1", {}, "About this site"), h("p", {}, `Made by fclib report, FCLIB ${site().version}, Apache-2.0. It asks no other host for anything.`), site().docs ? h("p", {}, h("a", { href: `${site().docs}/index.html` }, "The documentation"), "; ", h("a", { href: `${site().docs}/glossary.html` }, "its glossary"), "; ", h("a", { href: `${site().docs}/report.html` }, "how this report is made")) : "", ...Fclib.citeIt("Cite the collection and the software", site().cite.collection), h("h2", {}, "Libraries"), Fclib.libraries(site().libraries));
  };
})();
