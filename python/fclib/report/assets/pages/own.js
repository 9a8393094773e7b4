// a file of the visitor's own: read, drawn, analysed and solved in the browser; nothing is sent
"use strict";
(() => {
  const { h, number, facts } = Fclib;

  const KINDS = [
    "",
    "global",
    "local",
    "global_rolling",
    "local_rolling",
    "global_spin",
    "local_spin",
  ];
  Fclib.pages.own = async (page) => {
    page.append(
      h("h1", {}, "Your own file"),
      h(
        "p",
        {},
        "An FCLIB file of any version and formulation, or a problem as Siconos writes it in " +
          "a text. It is read, drawn, judged and solved here, in your browser: nothing leaves " +
          "this machine.",
      ),
    );
    if (!Fclib.values.site.module) {
      page.append(
        h("p", {}, "This site was made without the module for browsers, which would do that."),
      );
      return;
    }
    if (location.protocol === "file:") {
      page.append(...Fclib.servedBy("A browser loads no module from a folder of files."));
      return;
    }
    const said = h("p", { class: "small", role: "status" });
    const box = h("div", {});
    const kind = h(
      "select",
      { onchange: () => file && take(file) },
      KINDS.map((name) => h("option", { value: name }, name || "the only one")),
    );
    let file = null;
    const take = async (chosen) => {
      file = chosen;
      box.replaceChildren();
      said.className = "small";
      said.textContent = `${chosen.name} is read.`;
      try {
        const fclib = await Fclib.core();
        const { problem, solution, guesses } = await fclib.read(
          await chosen.arrayBuffer(),
          kind.value,
        );
        const sizes = await fclib.validate(problem);
        const islands = await fclib.islands(problem);
        const view = await Fclib.viewOf(fclib, problem);
        const list = [...problem.mu];
        const ends = [Math.min, Math.max].map((most) => list.reduce((a, b) => most(a, b), list[0]));
        if (file !== chosen) return;
        const merit = solution ? await fclib.merit(problem, solution) : null;
        if (view && solution) {
          const digits = Fclib.digits((await fclib.contact_merits(problem, solution)).status);
          Object.assign(view, Fclib.shower(problem, view)(solution.r, digits));
        }
        if (file !== chosen) return;
        said.textContent = "";
        const own = Fclib.panel(() => ({
          read: async () => ({ problem, solution }),
          current: () => file === chosen,
          merit: null,
          view,
          name: chosen.name,
        }));
        const known = {
          file: chosen.name,
          title: problem.info && problem.info.title,
          formulation: sizes.formulation,
          contacts: sizes.nc,
          "degrees of freedom": sizes.n || null,
          "bilateral constraints": sizes.p || null,
          μ: list.length
            ? ends[0] === ends[1]
              ? number(ends[0])
              : `${number(ends[0])} to ${number(ends[1])}`
            : null,
          islands: islands.count,
          guesses: guesses.length || null,
          "error of its solution": merit && number(merit.error),
        };
        box.replaceChildren(
          h("h2", {}, (problem.info && problem.info.title) || chosen.name),
          facts(Object.entries(known)),
          ...own.elements,
          ...(view
            ? []
            : [
                h(
                  "p",
                  { class: "soft" },
                  `Nothing says where its contacts are, and more than ${Fclib.LAID_OUT} are not ` +
                    "laid out as a graph.",
                ),
              ]),
        );
        if (view) own.show();
      } catch (error) {
        if (file !== chosen) return;
        said.className = "small bad";
        said.textContent = `${chosen.name}: ${error.message}`;
      }
    };
    const input = h("input", {
      type: "file",
      onchange: () => {
        const [one] = input.files;
        // the same file, written anew, is a change as well
        input.value = "";
        if (one) take(one);
      },
    });
    const drop = h(
      "div",
      {
        class: "panel drop",
        ondragover: (event) => {
          event.preventDefault();
          drop.classList.add("over");
        },
        ondragleave: () => drop.classList.remove("over"),
        ondrop: (event) => {
          event.preventDefault();
          drop.classList.remove("over");
          if (event.dataTransfer.files[0]) take(event.dataTransfer.files[0]);
        },
      },
      h(
        "div",
        { class: "controls" },
        h("label", {}, "drop a file here, or choose one", input),
        h("label", {}, "problem in it", kind),
      ),
    );
    page.append(drop, said, box);
  };
})();
