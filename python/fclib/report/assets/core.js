// what all pages share: elements, numbers, data on demand. Classic scripts, since a browser refuses
// modules and fetch() for files.
"use strict";
const Fclib = { values: {}, waiting: {}, pages: {} };

// an address leads to what the site does not have
Fclib.NotHere = class extends Error {};

// ---- data: a file calls put(), load() gives a promise of what it put
Fclib.put = (name, value) => {
  Fclib.values[name] = value;
};
// large data come compressed
Fclib.putPacked = (name, text) => {
  const found = atob(text);
  const bytes = new Uint8Array(found.length);
  // Uint8Array.from takes many times as long
  for (let k = 0; k < found.length; k++) bytes[k] = found.charCodeAt(k);
  Fclib.values[name] = new Response(
    new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip")),
  ).json();
};
Fclib.script = (src) => {
  Fclib.waiting[src] ||= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = src;
    script.onload = resolve;
    script.onerror = () => {
      delete Fclib.waiting[src];
      reject(new Error(`${script.src} is not there`));
    };
    document.head.append(script);
  });
  return Fclib.waiting[src];
};
Fclib.load = async (name) => {
  if (!(name in Fclib.values)) await Fclib.script(`data/${name}.js`);
  return (Fclib.values[name] = await Fclib.values[name]);
};
// the library that draws is large: pages without pictures do not wait for it
Fclib.plotly = async () => {
  if (!window.Plotly) await Fclib.script("assets/plotly.js");
  return window.Plotly;
};

// ---- elements; text is never taken for HTML
Fclib.h = (tag, attributes, ...children) => {
  const element = document.createElement(tag);
  Fclib.set(element, attributes || {});
  element.append(
    ...children.flat(3).filter((child) => child !== null && child !== undefined && child !== false),
  );
  return element;
};
Fclib.set = (element, attributes) => {
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "value" || key === "checked" || key === "selected") element[key] = value;
    else element.setAttribute(key, value === true ? "" : value);
  }
};

// names and what they are, if it is known
Fclib.facts = (pairs, kind = "facts") =>
  Fclib.h(
    "dl",
    { class: kind },
    pairs
      .filter(([, v]) => v !== null && v !== undefined && v !== "")
      .map(([name, v]) => [Fclib.h("dt", {}, name), Fclib.h("dd", {}, v)]),
  );
// what is not wanted at once, under a heading that opens it
Fclib.folded = (title, ...content) =>
  Fclib.h(
    "details",
    { class: "folded" },
    Fclib.h("summary", {}, Fclib.h("h2", {}, title)),
    ...content,
  );
// `names` of code in a text
Fclib.prose = (text) =>
  text.split("`").map((part, k) => (k % 2 ? Fclib.h("code", {}, part) : part));

Fclib.copyable = (text, label) => {
  const button = Fclib.h(
    "button",
    {
      type: "button",
      "aria-label": label ? `Copy ${label}` : "Copy",
      onclick: async () => {
        try {
          await navigator.clipboard.writeText(text);
          button.textContent = "copied";
        } catch {
          getSelection().selectAllChildren(code);
          button.textContent = "selected";
        }
        setTimeout(() => {
          button.textContent = "copy";
        }, 1500);
      },
    },
    "copy",
  );
  const code = Fclib.h("code", {}, text);
  const first = text
    .split("\n")
    .find((line) => line && !line.startsWith("import") && !line.startsWith("#"));
  return Fclib.h(
    "div",
    { class: "copy" },
    Fclib.h(
      "pre",
      {
        tabindex: 0,
        role: "region",
        "aria-label": label || `To copy: ${first || text}`,
      },
      code,
    ),
    button,
  );
};
// a text as a file to keep
Fclib.save = (name, text) => {
  const link = Fclib.h("a", {
    href: URL.createObjectURL(new Blob([text], { type: "text/plain" })),
    download: name,
  });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
};

// ---- addresses: a page, what it is of, its state
Fclib.to = (page, rest = [], params = {}) => {
  const query = new URLSearchParams(
    Object.entries(params).filter(
      ([, v]) => v !== undefined && v !== null && v !== "" && v !== false,
    ),
  ).toString();
  return (
    "#/" +
    `${[page, ...rest].map((part) => encodeURIComponent(part).replaceAll("%2F", "/")).join("/")}` +
    `${query ? `?${query}` : ""}`
  );
};
Fclib.link = (page, rest, params, text) =>
  Fclib.h("a", { href: Fclib.to(page, rest, params) }, text);

// ---- numbers, as a person reads them
Fclib.number = (value, digits = 3) => {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value) && Math.abs(value) < 1e6) return String(value);
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) {
    return value
      .toExponential(digits - 2)
      .replace("e+", "e")
      .replace(/\.0+e/, "e");
  }
  return String(Number(value.toPrecision(digits)));
};
Fclib.percent = (share) =>
  Number.isFinite(share) ? `${Math.round(1000 * share) / 10} %` : Fclib.number(null);
Fclib.tolerance = (tol) =>
  Number.isFinite(tol) ? tol.toExponential().replace("e+", "e") : Fclib.number(null);
// "1 family", "2 families"
Fclib.count = (number, one, many = `${one}s`) => `${number} ${number === 1 ? one : many}`;

/* how many of some rows of the catalogue are different problems, and how many are copies: as
   _numbers() of fclib/report/site.py, which counts the whole site and its families */
Fclib.tally = (rows) => {
  const copies = rows.filter((row) => row.same_as).length;
  return { problems: rows.length - copies, copies };
};
/* different problems; those with the data of another one are told apart */
Fclib.problems = ({ problems, copies }) =>
  Fclib.count(problems, "problem") +
  (copies ? ` and ${Fclib.count(copies, "copy", "copies")}` : "");

// ---- light and dark: the system's choice until a person makes another
Fclib.theme = {
  key: "fclib-theme",
  system: matchMedia("(prefers-color-scheme: dark)"),
  chosen: null,
  apply(name = this.chosen || (this.system.matches ? "dark" : "light")) {
    document.documentElement.dataset.theme = name;
    document.documentElement.classList.toggle("dark", name === "dark");
    document.dispatchEvent(new Event("fclib-theme"));
  },
  toggle() {
    this.chosen = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    try {
      localStorage.setItem(this.key, this.chosen);
    } catch {
      /* this page only */
    }
    this.apply();
  },
};
try {
  Fclib.theme.chosen = localStorage.getItem(Fclib.theme.key);
} catch {
  /* no storage here */
}
Fclib.theme.apply();
Fclib.theme.system.addEventListener("change", () => Fclib.theme.apply());
// paper is white and as wide as style.css says; what follows an event is done before the print
const paper = (on) => {
  document.documentElement.classList.toggle("paper", on);
  Fclib.theme.apply(on ? "light" : undefined);
  document.dispatchEvent(new Event("fclib-print"));
};
addEventListener("beforeprint", () => paper(true));
addEventListener("afterprint", () => paper(false));
Fclib.themeButton = () =>
  Fclib.h(
    "button",
    {
      type: "button",
      class: "quiet",
      id: "theme",
      "aria-label": "Light or dark",
      title: "Light or dark",
      onclick: () => Fclib.theme.toggle(),
    },
    "◐",
  );
Fclib.colour = (name) =>
  getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
