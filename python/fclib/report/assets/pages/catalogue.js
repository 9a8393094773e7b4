// all problems, filtered
"use strict";
(() => {
  const { h, number, to, facts } = Fclib;
  const {
    site,
    catalogue,
    problemLink,
    familyHref,
    solverLink,
    select,
    search,
    yesOrNumber,
    status,
    remembered,
  } = Fclib.parts;

  // a row may have several tags of a kind
  const many = (v) => (v === null || v === undefined || v === "" ? [] : String(v).split(", "));
  const TAGS = [
    ["kind", "kind"],
    ["class", "class"],
    ["formulation", "form"],
    ["application", "application"],
    ["status", "best known"],
    ["collection", "set"],
  ];
  const WIDE = "(min-width: 60rem)"; // a side column fits; style.css has the same
  const SLIDERS = ["nc", "n", "p", "density", "mu_max", "solved_by", "conditioning_W", "best_s"];
  /* two handles over the values of a column, by their ranks, so that each step tells some problems
     apart */
  const slider = (column, values, state, change) => {
    const steps = [...new Set(values)].sort((a, b) => a - b);
    if (steps.length < 2) return null;
    const last = steps.length - 1;
    const said = h("span", {});
    const at = (key, missing) => {
      const v = state[key];
      if (v === "") return missing;
      const k = steps.findIndex((x) => x >= Number(v));
      return k < 0 ? last : key.endsWith("-") && steps[k] > Number(v) && k ? k - 1 : k;
    };
    const handle = (key, missing, name) =>
      h("input", {
        type: "range",
        min: 0,
        max: last,
        step: 1,
        value: at(key, missing),
        "aria-label": `${column.label} ${name}`,
      });
    const low = handle(`${column.key}+`, 0, "from");
    const high = handle(`${column.key}-`, last, "to");
    const tell = () => {
      const ends = [low, high].map((one) => number(steps[one.value]));
      said.textContent = `${column.label} ${ends.join(" to ")}`;
    };
    const crossed = () => Number(low.value) > Number(high.value);
    const moved = (one, other) => () => {
      if (crossed()) other.value = one.value;
      tell();
      change(`${column.key}+`, Number(low.value) ? String(steps[low.value]) : "");
      change(`${column.key}-`, Number(high.value) < last ? String(steps[high.value]) : "");
    };
    low.addEventListener("input", moved(low, high));
    high.addEventListener("input", moved(high, low));
    tell();
    return h("div", { class: "range" }, said, low, high);
  };

  Fclib.pages.catalogue = async (page, rest, params, keep) => {
    const cat = await catalogue();
    const { read } = cat;
    const shownColumns = cat.columns.filter((c) => !c.hidden && c.key !== "thumb");
    const tags = TAGS.filter(([key]) => read[key])
      .map(([key, label]) => [
        key,
        label,
        [...new Set(cat.rows.flatMap((row) => many(row[key])))].sort(),
      ])
      .filter(([, , values]) => values.length > 1);
    const sliders = SLIDERS.map((key) => cat.columns.find((c) => c.key === key)).filter(Boolean);
    const keys = [
      "q",
      "family",
      "runs",
      ...tags.map(([key]) => key),
      ...sliders.flatMap((c) => [`${c.key}+`, `${c.key}-`]),
    ];
    const state = Object.fromEntries(keys.map((key) => [key, params.get(key) || ""]));
    const chosen = (key) => new Set(state[key] ? state[key].split("~") : []);
    // names, titles and what the family says: where a plain word is looked for
    const about = new Map(
      site().families.map((f) => [
        f.name,
        [f.title, f.description, f.application, f.kind].join(" ").toLowerCase(),
      ]),
    );
    const memory = new Map();
    const words = (k) => {
      if (!memory.has(k)) {
        const marks = TAGS.map(([key]) => read[key] && read[key](k));
        const all = [read.id(k), read.title && read.title(k), ...marks, about.get(read.family(k))];
        memory.set(k, all.filter(Boolean).join(" ").toLowerCase());
      }
      return memory.get(k);
    };
    // there before they are asked for
    (window.requestIdleCallback || setTimeout)(() => {
      for (let k = 0; k < cat.size; k++) words(k);
    });
    const says = h("p", { class: "small", role: "status" });
    const told = (own, all) =>
      `${own.problems} of ${Fclib.count(all.problems, "problem")}` +
      (all.copies ? ` and ${own.copies} of ${Fclib.count(all.copies, "copy", "copies")}` : "");
    let listed = [];
    const rows = () => {
      let parsed;
      try {
        parsed = Fclib.parseFilter(state.q, { columns: shownColumns, read, words });
      } catch (error) {
        says.className = "small bad";
        says.textContent =
          `The filter is not understood: ${error.message}. ` +
          `${listed.length ? "The list is as it was before." : "Nothing is listed."}`;
        return listed;
      }
      const limits = sliders.flatMap(({ key }) =>
        [
          [`${key}+`, (v, x) => v >= x],
          [`${key}-`, (v, x) => v <= x],
        ]
          .filter(([name]) => state[name] !== "")
          .map(([name, within]) => (k) => {
            const v = read[key](k);
            return v !== null && v !== undefined && within(v, Number(state[name]));
          }),
      );
      const sets = tags
        .map(([key]) => [key, chosen(key)])
        .filter(([, own]) => own.size)
        .map(
          ([key, own]) =>
            (k) =>
              many(read[key](k)).some((tag) => own.has(tag)),
        );
      const tests = [
        parsed.test,
        ...limits,
        ...sets,
        ...(state.family ? [(k) => read.family(k) === state.family] : []),
        ...(state.runs ? [(k) => read.runs(k)] : []),
      ];
      listed = cat.rows.filter(({ k }) => tests.every((test) => test(k)));
      const lost = listed.length
        ? []
        : parsed.parts
            .filter((part) => !cat.rows.some(({ k }) => part.test(k)))
            .map((part) => part.text);
      says.className = "small soft";
      says.textContent =
        told(Fclib.tally(listed), site()) +
        `${lost.length ? `; no problem at all has: ${lost.join(", ")}` : ""}`;
      return listed;
    };
    const format = {
      view: (v) => (v ? "yes" : ""),
      slater: yesOrNumber,
      best_tol: (v) => (v ? Fclib.tolerance(v) : "–"),
      solved_by: (v) => (v === null ? "–" : Fclib.percent(v)),
    };
    const picture = (row) =>
      read.thumb && row.thumb
        ? h("img", {
            class: "thumb",
            src: `thumbs/${row.k}.webp`,
            alt: "",
            loading: "lazy",
            width: 64,
            height: 48,
          })
        : null;
    const columns = shownColumns.map((c) => ({
      key: c.key,
      label: c.label,
      title: c.doc,
      head: c.key === "id",
      format: format[c.key],
      type:
        c.words ||
        [
          "id",
          "family",
          "formulation",
          "status",
          "best_solver",
          "view",
          "kind",
          "class",
          "application",
        ].includes(c.key)
          ? "text"
          : "number",
      cell:
        c.key === "id"
          ? (row) => h("span", { class: "named" }, picture(row), problemLink(row.id))
          : c.key === "family"
            ? (row) =>
                h(
                  "a",
                  { href: familyHref(read.collection ? row.collection : "", row.family) },
                  row.family,
                )
            : c.key === "best_solver"
              ? (row) => solverLink(row.best_solver)
              : c.key === "status"
                ? (row) => (row.status ? status(row.status) : "–")
                : undefined,
    }));
    const table = Fclib.table({
      caption: "Problems",
      name: "catalogue",
      columns,
      rows: rows(),
      page: 25,
      search: false,
      ...remembered(params, keep),
    });
    let waiting = 0;
    const update = (changes) => {
      Object.assign(state, changes);
      clearTimeout(waiting);
      waiting = setTimeout(() => {
        keep({ ...state, page: "" });
        table.update(rows());
      }, 30);
    };
    const change = (key) => (value) => update({ [key]: value === true ? "1" : value || "" });
    const chips = ([key, label, values]) =>
      h(
        "fieldset",
        { class: "choices" },
        h("legend", {}, label),
        values.map((value) =>
          h(
            "label",
            {},
            h("input", {
              type: "checkbox",
              checked: chosen(key).has(String(value)),
              onchange: (e) => {
                const own = chosen(key);
                if (e.target.checked) own.add(String(value));
                else own.delete(String(value));
                update({ [key]: [...own].join("~") });
              },
            }),
            String(value),
          ),
        ),
      );
    const values = (key) => [
      ["", "all"],
      ...[...new Set(cat.rows.map((row) => row[key]))].sort().map((v) => [v, v]),
    ];
    const count = keys.filter((key) => key !== "q" && state[key]).length;
    const filters = h(
      "details",
      { class: "filters", open: matchMedia(WIDE).matches },
      h("summary", {}, count ? `Narrow it down (${count} chosen)` : "Narrow it down"),
      select("family", values("family"), state.family, change("family")),
      read.runs &&
        h(
          "label",
          { class: "check" },
          h("input", {
            type: "checkbox",
            checked: Boolean(state.runs),
            onchange: (e) => change("runs")(e.target.checked),
          }),
          "with runs",
        ),
      tags.map(chips),
      h(
        "div",
        { class: "ranges" },
        sliders.map((c) =>
          slider(
            c,
            cat.rows.map((row) => row[c.key]).filter((v) => typeof v === "number"),
            state,
            (key, value) => update({ [key]: value }),
          ),
        ),
      ),
    );
    page.append(
      h("h1", {}, "Catalogue"),
      h(
        "div",
        { class: "controls" },
        search("filter", state.q, change("q"), "masonry contacts>50 class=hard"),
        says,
      ),
      h("div", { class: "browse" }, filters, table),
      Fclib.selection(() => listed),
      h(
        "details",
        {},
        h("summary", {}, "What the columns are"),
        facts(shownColumns.map((c) => [c.label, [c.doc, c.doc && " ", h("code", {}, c.key)]])),
      ),
      h(
        "details",
        {},
        h("summary", {}, "What the filter understands"),
        h(
          "p",
          { class: "small" },
          "A word is looked for in names, titles, kinds, classes, applications and the " +
            "descriptions of families. A condition is a column, a sign and a value, in this " +
            "order. A column has its label or its name, and the signs are = != < > <= >=. A " +
            "blank between two words or conditions means ",
          h("code", {}, "and"),
          ". You can also write ",
          h("code", {}, "or"),
          ", ",
          h("code", {}, "not"),
          ' and brackets. Put a text with blanks into "quotes".',
        ),
        h(
          "ul",
          { class: "small" },
          [
            "contacts > 100 and μ max < 0.5",
            "masonry (class = hard or class = open)",
            "form != G3DFC",
            "best solver = nsgs",
            '"tower of" not rt444',
            "solved by < 50%",
          ].map((text) =>
            h("li", {}, h("a", { href: to("catalogue", [], { q: text }) }, h("code", {}, text))),
          ),
        ),
        h("p", { class: "small" }, "The address of this page keeps the filter."),
      ),
    );
  };
})();
