// all families, and one of them
"use strict";
(() => {
  const { h, link, facts, prose, copyable } = Fclib;
  const { site, toleranceOf, familyHref, range, summaryColumns } = Fclib.parts;

  const familyCards = (list) =>
    h(
      "div",
      { class: "cards" },
      list.map((f) =>
        h(
          "article",
          { class: "panel" },
          f.scene || f.thumb
            ? h(
                "a",
                { href: familyHref(f.set, f.name), tabindex: -1, "aria-hidden": "true" },
                h("img", { src: f.scene || f.thumb, alt: "", loading: "lazy" }),
              )
            : null,
          h("h3", {}, h("a", { href: familyHref(f.set, f.name) }, f.title || f.name)),
          h("p", { class: "small" }, f.description || ""),
          h(
            "p",
            { class: "small soft" },
            [
              Fclib.problems(f),
              f.ranges.nc &&
                `${range(f.ranges.nc)} ${f.ranges.nc[1] === 1 ? "contact" : "contacts"}`,
              ...f.formulations,
            ]
              .filter(Boolean)
              .join(", "),
          ),
        ),
      ),
    );

  const MEASURES = { nc: "contacts", n: "degrees of freedom", density: "density", mu_max: "μ" };

  const distribution = (f) => [
    h("h2", {}, "Distribution"),
    h(
      "div",
      { class: "three" },
      f.histograms.map((one) =>
        Fclib.bars({ ...one, label: MEASURES[one.key], name: `${f.name}-${one.key}` }),
      ),
    ),
    h(
      "p",
      { class: "small" },
      "The numbers are in the ",
      link("catalogue", [], { family: f.name }, "catalogue"),
      ".",
    ),
  ];

  Fclib.pages.families = async (page) => {
    const { families: all } = site();
    const sets = [...new Set(all.map((f) => f.set))];
    page.append(
      h("h1", {}, "Families"),
      h(
        "p",
        {},
        `${Fclib.problems(site())} in ${Fclib.count(all.length, "family", "families")}` +
          `${sets.length > 1 ? ` of ${sets.length} sets` : ""}.`,
      ),
      ...sets
        .flatMap((set) => [
          h("h2", {}, set || "Not in the catalogue"),
          familyCards(all.filter((f) => f.set === set)),
        ])
        .filter(Boolean),
    );
  };

  Fclib.pages.family = async (page, rest, params) => {
    const s = site();
    const name = rest[rest.length - 1];
    const set = rest.length > 1 ? rest[0] : "";
    const f =
      s.families.find((one) => one.name === name && (one.set || "") === set) ||
      s.families.find((one) => one.name === name);
    if (!f) throw new Fclib.NotHere(`There is no family ${rest.join("/")}.`);
    page.append(
      h("h1", {}, f.title || f.name),
      h(
        "div",
        { class: "two first" },
        f.scene || f.thumb
          ? h("figure", {}, h("img", { src: f.scene || f.thumb, alt: f.description || f.name }))
          : null,
        h(
          "div",
          {},
          h("p", {}, f.description || ""),
          (f.text || []).map((text) => h("p", { class: "small" }, prose(text))),
          facts([
            ["name", f.set ? `${f.set}/${f.name}` : f.name],
            ["problems", link("catalogue", [], { family: f.name }, Fclib.problems(f))],
            ["application", f.application],
            ["friction", f.friction],
            ["original by", f.authors],
            ["formulations", f.formulations.join(", ")],
            ...Object.entries(f.ranges).map(([key, ends]) => [MEASURES[key], range(ends)]),
          ]),
        ),
      ),
    );
    if (s.docs)
      page.append(
        h(
          "p",
          {},
          h("a", { href: `${s.docs}/families/${f.name}.html` }, "This family in the documentation"),
        ),
      );
    if (f.histograms.length) page.append(...distribution(f));
    if (s.headlines.some((head) => head && head.tables[f.name])) {
      const t = toleranceOf(params);
      const head = s.headlines[t];
      page.append(
        h("h2", {}, "Solvers on this family"),
        h(
          "p",
          {},
          s.tolerances.map((tol, k) => [
            k ? " · " : "",
            k === t
              ? h("b", {}, `tolerance ${Fclib.tolerance(tol)}`)
              : link("family", rest, { tol: k }, `tolerance ${Fclib.tolerance(tol)}`),
          ]),
          " · ",
          link("profiles", [], { family: f.name, tol: t }, "profiles"),
        ),
      );
      if (head && head.tables[f.name])
        page.append(
          Fclib.table({
            caption: `CPU times on ${f.name}`,
            columns: summaryColumns(),
            rows: head.tables[f.name],
            page: 60,
          }),
        );
    }
    if (f.parameters)
      page.append(
        h("h2", {}, "Parameters of the scene"),
        Fclib.table({
          caption: "As in the collection",
          rows: f.parameters,
          page: 60,
          columns: [
            { key: 0, label: "parameter", head: true },
            { key: 1, label: "default", type: "text" },
            { key: 2, label: "unit" },
            { key: 3, label: "meaning", wrap: true },
          ],
        }),
        h("h2", {}, "Take it"),
        copyable(
          `fclib collection build ${f.set ? `${f.set}/` : ""}${f.name} --out collection`,
          "the command",
        ),
      );
    page.append(
      ...Fclib.citeIt("Cite it", f.bibtex),
      h("p", { class: "small" }, f.citation ? `The data: ${f.citation}.` : ""),
    );
  };
})();
