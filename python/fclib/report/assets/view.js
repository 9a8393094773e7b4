// the page of one problem, by `fclib view`
"use strict";
Fclib.view = (view) => {
  const { h, number } = Fclib;
  const facts = { file: view.file, formulation: view.formulation, contacts: view.nc, "degrees of freedom": view.n || null, "bilateral constraints": view.p || null };
  if (view.merit) facts["error of the solution"] = number(view.merit.error);
  document.title = view.title || view.file;
  document.querySelector("main").append(
    h("h1", {}, view.title || view.file),
    h("dl", { class: "facts" }, Object.entries(facts).filter(([, v]) => v !== null && v !== "").map(([name, v]) => [h("dt", {}, name), h("dd", {}, String(v))])),
    ...view.network ? [Fclib.scene(view, view.file)] : [h("p", {}, "No contact in this problem.")],
    ...view.network && !view.reactions ? [h("p", { class: "soft" }, "The file holds no solution; fclib solve --write stores one.")] : [],
    ...view.spectrum && view.spectrum.rank > 1 ? [h("h2", {}, "Spectrum"), Fclib.spectrum(view.spectrum, view.file)] : [],
    h("h2", {}, "Patterns"), Fclib.patterns(view.patterns), ...[Fclib.texts(view)].filter(Boolean));
  document.querySelector("footer").append(h("details", {}, h("summary", {}, "Libraries in this page"), Fclib.libraries(view.libraries)));
  document.querySelector("header.top > div").append(Fclib.themeButton());
};
