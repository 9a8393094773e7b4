// what there is, which solver suits, and how all of them do on the problems that are meant
"use strict";
(() => {
  const { h, link, facts } = Fclib;
  const {
    site,
    select,
    toleranceOf,
    familyChoices,
    styleOf,
    status,
    summaryColumns,
    machine,
    captionOf,
    remembered,
  } = Fclib.parts;
  const MOST = 8; // curves beside each other
  const FEW = 5; // open problems on this page

  /* as it is stored: all problems at a tolerance */
  const stored = (t) => {
    const head = site().headlines[t];
    if (!head) return null;
    const left = head.not_compared.map((r) => `${r.solver} (${r.solved} of ${r.of})`);
    const end = head.taus[head.taus.length - 1];
    return {
      end,
      series: head.order.map((k) => ({
        name: head.solvers[k],
        legend: head.legend[k],
        x: head.taus,
        y: head.curves[k],
        style: styleOf(head.solvers[k]),
        band: head.bands && [head.bands[0][k], head.bands[1][k]],
      })),
      note:
        captionOf(head) +
        (head.bands ? "; bands: 95 % by drawing families and problems anew" : "") +
        (left.length
          ? `; not compared, having run or taking too few of them: ${left.join(", ")}`
          : ""),
    };
  };
  /* of the problems that a person means, which Python has not summed */
  const chosen = ({ like, cat, bench, costs }) => {
    const s = site();
    const names = s.solvers.map((one) => one.label);
    const solvers = Fclib.widest(bench, costs, names, like, s.common);
    const { instances, values, shown, weights } = Fclib.profile(bench, costs, {
      solvers,
      keep: like,
      own: false,
      weigh: s.weigh,
      kind: "performance",
      families: cat.read.family,
      contacts: cat.read.nc,
    });
    const ratios = shown.flat().filter(Number.isFinite);
    if (!instances.length || !ratios.length) return null;
    const largest = ratios.reduce((a, b) => Math.max(a, b));
    const series = solvers.map((k, i) => ({
      name: names[k],
      legend: Fclib.legend(names[k], values[i]),
      style: k,
      ...Fclib.shares(shown[i], weights[i], 1),
    }));
    const end = (one) => one.y[one.y.length - 1];
    return {
      end: Math.max(2, Math.min(1e4, 1.2 * largest)),
      series: series.sort((a, b) => end(b) - end(a)),
      note:
        `${Fclib.count(instances.length, "instance")} that all of these have run and take; ` +
        `each family weighs the same; ${s.judged}`,
    };
  };
  const profile = (found) => {
    const s = site();
    const tol = s.tolerances[found.tol];
    const title = `Performance profile at ${Fclib.tolerance(tol)}`;
    const drawn = found.narrowed ? chosen(found) : stored(found.tol);
    const more = h(
      "p",
      {},
      link("profiles", [], { tol: found.tol }, "Look closer: choose families, solvers, measures"),
    );
    if (!drawn) return [h("p", { class: "panel" }, "No two solvers compare on these."), more];
    const { series, end, note } = drawn;
    const best = series.length > MOST ? `; the best ${MOST} of ${series.length} solvers` : "";
    return [
      Fclib.lines({
        half: true,
        name: `profile-${tol}`,
        title,
        series: series.slice(0, MOST),
        xlog: true,
        xrange: [1, end],
        yrange: [0, 1],
        ypercent: true,
        xlabel: "τ: CPU time over that of the best",
        ylabel: "instances solved within τ",
        xname: "τ",
        note: `${note}${best}.`,
      }),
      more,
    ];
  };

  const withRuns = (page, params, keep) => {
    const s = site();
    const o = s.overview;
    const curves = h("div", {});
    const state = { tol: toleranceOf(params), family: params.get("family") || "" };
    const rows = () => (s.headlines[state.tol] || { tables: {} }).tables[state.family] || [];
    const table = Fclib.table({
      caption:
        "CPU times of the solvers, over the instances that all of them have run and take; the " +
        "virtual best is the fastest of all on each",
      columns: summaryColumns(true),
      rows: rows(),
      page: 60,
      search: true,
      ...remembered(params, keep),
    });
    const chooser = Fclib.chooser(params, keep, (found) => {
      curves.replaceChildren(...profile(found));
      if (found.tol !== state.tol) {
        state.tol = found.tol;
        table.update(rows());
      }
    });
    page.append(h("div", { class: "two first" }, chooser, curves));
    if (s.tolerances.length > 1 && s.work && s.work.length)
      page.append(
        h("h2", {}, "What an accuracy costs"),
        Fclib.work({
          name: "work-precision",
          title: "CPU time by tolerance",
          rows: s.work,
          style: styleOf,
          xlabel: "CPU time in the mean [s]",
          note:
            "Shifted geometric means over the instances that all have run and take at a " +
            "tolerance, each family weighs the same, a failure charged " +
            `${s.charges.penalty} times the limit; ${machine(o)}.`,
        }),
      );
    page.append(
      h("h2", {}, "Solvers"),
      h(
        "div",
        { class: "controls" },
        select("family", familyChoices(), state.family, (family) => {
          state.family = family;
          keep({ family });
          table.update(rows());
        }),
      ),
      table,
      h(
        "p",
        { class: "small soft" },
        "Every error is recomputed from the problem and the returned solution. ",
        h("em", {}, "Solved"),
        " means that the relative error meets the tolerance within the limits, or that a proof " +
          `that there is no solution was checked; ${s.judged}. Each family weighs the same.`,
      ),
    );
  };
  const aboutRuns = (page) => {
    const o = site().overview;
    if (o.along.length)
      page.append(
        h("h2", {}, "Along sequences"),
        h(
          "p",
          {},
          "Each solver solved consecutive problems from its own solution of the step " +
            "before (warm), and from nothing (cold). All else on these pages is of the cold " +
            "runs.",
        ),
        Fclib.table({
          caption: "Warm runs beside cold runs of the same steps",
          rows: o.along,
          page: 60,
          columns: [
            "sequence",
            "solver",
            "tol",
            "cold CPU / warm CPU",
            "iterations warm",
            "iterations cold",
            "solved warm",
            "solved cold",
            "of",
            "drift",
          ].map((key) => ({ key, label: key, head: key === "sequence" })),
        }),
      );
    page.append(
      h("h2", {}, "How the runs ended"),
      Fclib.table({
        caption: "Statuses of all runs",
        rows: Object.entries(o.statuses).map(([name, v]) => ({ name, ...v })),
        columns: [
          { key: "name", label: "status", head: true, cell: (r) => status(r.name) },
          { key: "count", label: "runs" },
          { key: "share", label: "share", type: "number", format: Fclib.percent },
          { key: "meaning", label: "meaning", wrap: true },
        ],
      }),
      h("h2", {}, "Where and what"),
      facts([
        ["machine", machine(o)],
        [
          "campaigns",
          o.campaigns
            .map(
              (c) =>
                `${c.name}: ${c.done} of ${Fclib.count(c.planned, "run")}` +
                `${c.ended ? "" : ", not ended"}`,
            )
            .join("; "),
        ],
      ]),
    );
  };

  Fclib.pages.overview = async (page, rest, params, keep) => {
    const s = site();
    const o = s.overview;
    const counts = [
      o && Fclib.count(s.solvers.length, "solver"),
      Fclib.problems(s),
      Fclib.count(s.families.length, "family", "families"),
      o && `${Fclib.count(o.runs, "run")}, ${Fclib.percent(o.share)} of them solved`,
    ].filter(Boolean);
    page.append(
      h("h1", {}, s.title),
      h(
        "p",
        { class: "small words" },
        `${counts.join(", ")}. ${o ? "" : "No runs were given to this report. "}`,
        link("catalogue", [], {}, "All problems"),
        " · ",
        link("families", [], {}, "all families"),
        " · ",
        link("solvers", [], {}, "all solvers"),
        " · ",
        link("classes", [], {}, "what is open"),
      ),
    );
    if (o) withRuns(page, params, keep);
    const open = s.ratings.filter((one) => one.open.length);
    if (open.length) page.append(h("h2", {}, "Open problems"));
    for (const one of open) page.append(Fclib.openProblems(one, FEW));
    if (open.length)
      page.append(h("p", {}, link("classes", [], {}, "All open problems, and how to better them")));
    if (o) aboutRuns(page);
  };
})();
