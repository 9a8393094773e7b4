// what there is, and which solver suits
"use strict";
(() => {
  const { h, link, facts } = Fclib;
  const {
    site,
    select,
    tolerances,
    lastTolerance,
    familyChoices,
    styleOf,
    status,
    summaryColumns,
    machine,
    captionOf,
    familyCards,
    remembered,
    catalogue,
  } = Fclib.parts;

  Fclib.pages.overview = async (page, rest, params, keep) => {
    const s = site();
    const o = s.overview;
    page.append(h("h1", {}, s.title));
    if (!o) {
      page.append(
        h(
          "p",
          {},
          `${s.problems} problems in ${s.families.length} families. No runs were given to ` +
            "this report.",
        ),
      );
    } else {
      page.append(
        h(
          "p",
          {},
          `${s.solvers.length} solvers on ${o.problems} problems` +
            `${s.problems > o.problems ? ` of ${s.problems} in the catalogue` : ""}. Every ` +
            "error is recomputed from the problem and the returned solution: ",
          h("em", {}, "solved"),
          " means that the relative error meets the tolerance within the limits, or that a " +
            `proof that there is no solution was checked; ${s.judged}. Solvers are compared on ` +
            "the instances that all of them have run and take, and each family weighs the same.",
        ),
        h(
          "ul",
          { class: "figures" },
          [
            [s.problems, "problems"],
            [s.families.length, "families"],
            [s.solvers.length, "solvers"],
            [o.runs, "runs"],
            [Fclib.percent(o.share), "of them solved"],
          ].map(([value, name]) =>
            h(
              "li",
              {},
              h("b", {}, value.toLocaleString("en").replaceAll(",", " ")),
              h("span", {}, name),
            ),
          ),
        ),
      );
      page.append(Fclib.chooser(catalogue, params, keep));
      page.append(
        h("h2", {}, "Performance profiles"),
        h(
          "p",
          {},
          "What share of the instances a solver has solved within a multiple τ of the CPU " +
            "time of the best solver on each. At the left: how often it is the fastest. At the " +
            "right: how often it succeeds at all.",
        ),
      );
      const charts = h("div", { class: "two" });
      s.headlines.forEach((head, t) => {
        if (!head) return;
        const shown = head.order.map((k) => ({
          name: head.solvers[k],
          legend: head.legend[k],
          x: head.taus,
          y: head.curves[k],
          style: styleOf(head.solvers[k]),
          band: head.bands && [head.bands[0][k], head.bands[1][k]],
        }));
        const left = head.not_compared.map((r) => `${r.solver} (${r.solved} of ${r.of})`);
        charts.append(
          h(
            "section",
            {},
            h("h3", {}, `Tolerance ${Fclib.tolerance(s.tolerances[t])}`),
            Fclib.lines({
              half: true,
              name: `profile-${s.tolerances[t]}`,
              title: `Performance profile at ${s.tolerances[t]}`,
              series: shown.slice(0, 12),
              xlog: true,
              xrange: [1, head.taus[head.taus.length - 1]],
              yrange: [0, 1],
              ypercent: true,
              xlabel: "τ: CPU time over that of the best",
              ylabel: "instances solved within τ",
              xname: "τ",
              note:
                captionOf(head) +
                (head.bands ? "; bands: 95 % by drawing families and problems anew" : "") +
                (left.length
                  ? `; not compared, having run or taking too few of them: ${left.join(", ")}`
                  : "") +
                `${shown.length > 12 ? `; the best 12 of ${shown.length} solvers` : ""}.`,
            }),
            h(
              "p",
              {},
              link("profiles", [], { tol: t }, "Look closer: choose families, solvers, measures"),
            ),
          ),
        );
      });
      page.append(charts);
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
      page.append(h("h2", {}, "Solvers"));
      const state = {
        tol: Number(params.get("tol") ?? lastTolerance()),
        family: params.get("family") || "",
      };
      const rows = () => (s.headlines[state.tol] || { tables: {} }).tables[state.family] || [];
      const table = Fclib.table({
        caption:
          "CPU times of the solvers, over the instances that all of them have run and take; " +
          "the virtual best is the fastest of all on each",
        columns: summaryColumns(true),
        rows: rows(),
        page: 60,
        search: true,
        ...remembered(params, keep),
      });
      const change = (key) => (value) => {
        state[key] = key === "tol" ? Number(value) : value;
        keep({ [key]: value });
        table.update(rows());
      };
      page.append(
        h(
          "div",
          { class: "controls" },
          select("tolerance", tolerances(), state.tol, change("tol")),
          select("family", familyChoices(), state.family, change("family")),
        ),
        table,
      );
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
          ["machine", `${o.node || "?"}, ${o.cpu || "?"}`],
          [
            "campaigns",
            o.campaigns
              .map(
                (c) => `${c.name}: ${c.done} of ${c.planned} runs${c.ended ? "" : ", not ended"}`,
              )
              .join("; "),
          ],
        ]),
      );
    }
    page.append(h("h2", {}, "Families"), familyCards(s.families));
  };
})();
