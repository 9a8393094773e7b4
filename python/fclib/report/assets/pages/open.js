// which problems are easy, hard and open
"use strict";
(() => {
  const { h, to } = Fclib;
  const { site } = Fclib.parts;

  Fclib.pages.classes = async (page) => {
    const s = site();
    const list = s.standings || [];
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
          "No stored runs came with this report: they are in the package fclib-collection.",
        ),
      );
    for (const one of list) {
      page.append(h("h2", {}, one.set), h("p", { class: "small" }, `Classes ${one.basis}.`));
      if (one.open.length)
        page.append(
          Fclib.table({
            caption: `Open problems of ${one.set}: the best error known, and by whom`,
            rows: one.open,
            page: 50,
            columns: [
              {
                key: "problem",
                label: "problem",
                head: true,
                cell: (r) =>
                  s.known && s.known.includes(r.problem)
                    ? h("a", { href: to("problem", r.problem.split("/")) }, r.problem)
                    : r.problem,
              },
              { key: "error", label: "best error", type: "number" },
              { key: "by", label: "by", wrap: true },
              { key: "date", label: "date" },
            ],
          }),
          h("p", {}, "Better one of them:"),
          Fclib.copyable(
            `fclib collection status ${one.open[0].problem} --out open.hdf5      # the ` +
              "problem, with the best solution known\nfclib check open.hdf5 " +
              "                                # its error, as it will be judged\nfclib " +
              'collection take yours.hdf5 --by "you, and how"  # taken where it is better by a ' +
              "tenth",
            "the commands",
          ),
        );
      page.append(
        Fclib.table({
          caption: `Classes of ${one.set}, by family`,
          rows: one.families,
          page: 60,
          columns: [
            { key: "family", label: "family", head: true },
            { key: "easy", label: "easy" },
            { key: "hard", label: "hard" },
            { key: "open", label: "open" },
          ],
        }),
      );
    }
  };
})();
