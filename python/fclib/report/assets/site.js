// which page, by the part of the address after #: a page's state is in its address
"use strict";
(() => {
  const { h } = Fclib;
  const NAVIGATION = [
    ["overview", "Overview"],
    ["profiles", "Profiles"],
    ["catalogue", "Catalogue"],
    ["families", "Families"],
    ["solvers", "Solvers"],
    ["classes", "Open"],
    ["own", "Your file"],
  ];
  const ABOVE = { family: "families", problem: "catalogue", solver: "solvers" };
  const main = document.querySelector("main");
  let turn = 0;
  const parse = () => {
    const [path, query] = location.hash.replace(/^#\/?/, "").split("?");
    const [page, ...rest] = path.split("/").map(decodeURIComponent);
    return { page: page || "overview", rest, params: new URLSearchParams(query || "") };
  };
  const show = async () => {
    const own = ++turn;
    const { page, rest, params } = parse();
    const draw = Fclib.pages[page];
    const nav = document.querySelector("nav");
    nav
      .querySelectorAll("a")
      .forEach((a) =>
        a.dataset.page === (ABOVE[page] || page)
          ? a.setAttribute("aria-current", "page")
          : a.removeAttribute("aria-current"),
      );
    const here = nav.querySelector("[aria-current]");
    // the list of pages may be wider than a phone
    if (here) nav.scrollLeft = here.offsetLeft - nav.offsetLeft;
    const target = h("div", { class: "fade" });
    // what a page keeps in its address, without a new entry in the history
    const keep = (changes) => {
      if (own !== turn) return;
      for (const [key, value] of Object.entries(changes)) {
        if (value === undefined || value === null || value === "" || value === false)
          params.delete(key);
        else params.set(key, value);
      }
      history.replaceState(null, "", Fclib.to(page, rest, Object.fromEntries(params)));
    };
    try {
      if (!draw) throw new Fclib.NotHere(`There is no page ${page}.`);
      await draw(target, rest, params, keep);
    } catch (error) {
      if (!(error instanceof Fclib.NotHere)) console.error(error);
      target.replaceChildren(
        h("h1", {}, "Not here"),
        h("p", {}, error.message),
        h("p", {}, Fclib.link("overview", [], {}, "To the overview")),
      );
    }
    if (own !== turn) return;
    // a browser keeps few contexts of WebGL
    main.querySelectorAll(".js-plotly-plot").forEach((plot) => Plotly.purge(plot));
    main.replaceChildren(target);
    const head = target.querySelector("h1");
    document.title = head ? `${head.textContent} – FCLIB` : "FCLIB";
    main.dataset.page = page;
    if (own > 1) {
      scrollTo(0, 0);
      main.focus({ preventScroll: true });
    }
  };
  const start = async () => {
    const site = await Fclib.load("site");
    const nav = document.querySelector("nav");
    const there = NAVIGATION.filter(
      ([page]) =>
        (site.tolerances.length || page !== "profiles") && (site.module || page !== "own"),
    );
    nav.append(
      ...there.map(([page, name]) => h("a", { href: Fclib.to(page), "data-page": page }, name)),
    );
    nav.after(Fclib.themeButton());
    document
      .querySelector("footer")
      .append(
        `Made by fclib report, FCLIB ${site.version}. Costs have six digits. `,
        Fclib.link("about", [], {}, "About this site"),
      );
    addEventListener("hashchange", show);
    show();
  };
  start().catch((error) => {
    main.textContent = error.message;
  });
})();
