// the page of one problem, by `fclib view`
"use strict";
Fclib.view = (view) => {
  const { h, number } = Fclib;
  const { compute } = view;
  if (compute) Fclib.values.site = compute;
  const known = {
    file: view.file,
    formulation: view.formulation,
    contacts: view.nc,
    "degrees of freedom": view.n || null,
    "bilateral constraints": view.p || null,
  };
  if (view.merit) known["error of the solution"] = number(view.merit.error);
  document.title = view.title || view.file;
  document
    .querySelector("main")
    .append(
      h("h1", {}, view.title || view.file),
      Fclib.stage(
        view.network ? Fclib.scene(view, view.file) : h("p", {}, "It has no contact."),
        Object.entries(known),
      ),
      view.network && !view.reactions
        ? h("p", { class: "soft" }, "The file holds no solution; fclib solve --write stores one.")
        : "",
      ...(compute ? Fclib.computeIt(compute, view, view.file) : []),
      ...Fclib.drawings(view, view.file),
    );
  document
    .querySelector("footer")
    .append(
      h("details", {}, h("summary", {}, "Libraries in this page"), Fclib.libraries(view.libraries)),
    );
  document.querySelector("header.top > div").append(Fclib.themeButton());
};
