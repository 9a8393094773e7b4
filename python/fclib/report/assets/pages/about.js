// what the site is made with
"use strict";
(() => {
  const { h } = Fclib;
  const { site } = Fclib.parts;

  Fclib.pages.about = async (page) => {
    page.append(
      h("h1", {}, "About this site"),
      h(
        "p",
        {},
        `Made by fclib report, FCLIB ${site().version}, Apache-2.0. It asks no other host ` +
          "for anything.",
      ),
      site().docs
        ? h(
            "p",
            {},
            h("a", { href: `${site().docs}/index.html` }, "The documentation"),
            "; ",
            h("a", { href: `${site().docs}/glossary.html` }, "its glossary"),
            "; ",
            h("a", { href: `${site().docs}/report.html` }, "how this report is made"),
          )
        : "",
      ...Fclib.citeIt("Cite the collection and the software", site().cite.collection),
      h("h2", {}, "Libraries"),
      Fclib.libraries(site().libraries),
    );
  };
})();
