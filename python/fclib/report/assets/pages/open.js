// which problems are easy, hard and open
"use strict";
(() => {
  const { h, copyable } = Fclib;
  const { site, problemLink } = Fclib.parts;

  /* the open problems of a set with the best errors known, or the first of them */
  Fclib.openProblems = (one, most = Infinity) => {
    const shown = one.open.slice(0, most);
    const rest = one.open.length - shown.length;
    const dated = shown.some((r) => r.date);
    const found = shown.some((r) => r.by);
    return Fclib.table({
      caption:
        `${Fclib.count(one.open.length, "open problem")} of ${one.set}` +
        `${rest ? `, the first ${shown.length}` : ""}` +
        (found ? ": the best error known, and by whom" : ", of which no error is known"),
      rows: shown,
      page: 50,
      columns: [
        { key: "problem", label: "problem", head: true, cell: (r) => problemLink(r.problem) },
        ...(found
          ? [
              { key: "error", label: "best error", type: "number" },
              { key: "by", label: "by", wrap: true, format: (v) => v || "no solver returned any" },
            ]
          : []),
        ...(dated ? [{ key: "date", label: "date" }] : []),
      ],
    });
  };
  const better = (one) => {
    const { name } = one.open.find((r) => r.by) || one.open[0];
    const steps = one.published
      ? [
          [`fclib collection status ${name} --out open.hdf5`, "it, with the best solution"],
          ["fclib check open.hdf5", "its error, as it will be judged"],
          ['fclib collection take yours.hdf5 --by "you, and how"', "taken if better by a tenth"],
        ]
      : [
          ["fclib solve --time-limit 600 --write FILE", "the solver auto, with more time"],
          ["fclib check FILE", "the error of the stored solution, as it is judged here"],
        ];
    const wide = Math.max(...steps.map(([command]) => command.length));
    return [
      h("p", {}, "How do you better one of them?"),
      copyable(
        steps.map(([command, why]) => `${command.padEnd(wide)}  # ${why}`).join("\n"),
        "the commands",
      ),
    ];
  };

  Fclib.pages.classes = async (page) => {
    const list = site().ratings;
    page.append(
      h("h1", {}, "Easy, hard and open"),
      h(
        "p",
        {},
        "A problem is easy if more than half of the solvers that take it solve it, and hard " +
          "if fewer do. It is open if no solver has solved it, and nobody else's solution is " +
          "within the tolerance.",
      ),
    );
    if (!list.length)
      page.append(
        h(
          "p",
          {},
          "None of these problems has a class: no solver of this report has run them, and they " +
            "are not among the stored runs of the package fclib-collection.",
        ),
      );
    for (const one of list) {
      page.append(h("h2", {}, one.set));
      page.append(
        one.open.length ? Fclib.openProblems(one) : h("p", {}, "Each of these problems is solved."),
        ...(one.open.length ? better(one) : []),
        Fclib.table({
          caption:
            `Classes of ${one.set}, by family` +
            (one.published ? ": of the problems in this report" : ""),
          rows: one.families,
          page: 60,
          columns: [
            { key: "family", label: "family", head: true },
            { key: "easy", label: "easy" },
            { key: "hard", label: "hard" },
            { key: "open", label: "open" },
          ],
        }),
        h("p", { class: "small soft" }, `Classes ${one.basis}.`),
      );
    }
  };
})();
