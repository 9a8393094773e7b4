// what all pages share: elements, numbers, data on demand. Classic scripts, since a browser refuses
// modules and fetch() for files.
"use strict";
const Fclib = { values: {}, waiting: {}, pages: {} };

// an address leads to what the site does not have
Fclib.NotHere = class extends Error {};

// ---- data: a file calls put(), load() gives a promise of what it put
Fclib.put = (name, value) => { Fclib.values[name] = value; };
Fclib.load = (name) => {
  if (name in Fclib.values) return Promise.resolve(Fclib.values[name]);
  if (!(name in Fclib.waiting)) {
    Fclib.waiting[name] = new Promise((resolve, reject) => {
      const script = document.createElement("script");
      script.src = `data/${name}.js`;
      script.onload = () => resolve(Fclib.values[name]);
      script.onerror = () => { delete Fclib.waiting[name]; reject(new Error(`${script.src} is not there`)); };
      document.head.append(script);
    });
  }
  return Fclib.waiting[name];
};

// ---- elements; text is never taken for HTML
Fclib.h = (tag, attributes, ...children) => {
  const element = document.createElement(tag);
  Fclib.set(element, attributes || {});
  element.append(...children.flat(3).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
};
Fclib.svg = (tag, attributes, ...children) => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  Fclib.set(element, attributes || {});
  element.append(...children.flat(3).filter((child) => child !== null && child !== undefined));
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

// ---- addresses: a page, what it is of, its state
Fclib.to = (page, rest = [], params = {}) => {
  const query = new URLSearchParams(Object.entries(params).filter(([, v]) => v !== undefined && v !== null && v !== "" && v !== false)).toString();
  return `#/${[page, ...rest].map((part) => encodeURIComponent(part).replaceAll("%2F", "/")).join("/")}${query ? `?${query}` : ""}`;
};
Fclib.link = (page, rest, params, text) => Fclib.h("a", { href: Fclib.to(page, rest, params) }, text);

// ---- numbers, as a person reads them
Fclib.number = (value, digits = 3) => {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value) && Math.abs(value) < 1e6) return String(value);
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) {
    return value.toExponential(digits - 2).replace("e+", "e").replace(/\.0+e/, "e");
  }
  return String(Number(value.toPrecision(digits)));
};
Fclib.percent = (share) => `${Math.round(1000 * share) / 10} %`;
Fclib.tolerance = (tol) => tol.toExponential().replace("e+", "e");

// ---- what a person keeps
Fclib.saveText = (name, text, type) => {
  const url = URL.createObjectURL(new Blob([text], { type }));
  const link = Fclib.h("a", { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
};
Fclib.csv = (columns, rows) => {
  const cell = (value) => {
    const text = value === null || value === undefined ? "" : String(value);
    return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  return [columns, ...rows].map((row) => row.map(cell).join(",")).join("\n") + "\n";
};

// ---- light and dark: the system's choice until a person makes another
Fclib.theme = {
  key: "fclib-theme",
  stored() { try { return localStorage.getItem(this.key); } catch { return null; } },
  apply(name) {
    if (name) document.documentElement.dataset.theme = name;
    else delete document.documentElement.dataset.theme;
  },
  isDark() {
    const name = document.documentElement.dataset.theme;
    return name ? name === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  },
  toggle() {
    const name = this.isDark() ? "light" : "dark";
    this.apply(name);
    try { localStorage.setItem(this.key, name); } catch { /* this page only */ }
    document.dispatchEvent(new Event("fclib-theme"));
  },
};
Fclib.theme.apply(Fclib.theme.stored());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => document.dispatchEvent(new Event("fclib-theme")));
Fclib.themeButton = () => Fclib.h("button", {
  type: "button", class: "quiet", id: "theme", "aria-label": "Light or dark", title: "Light or dark",
  onclick: () => Fclib.theme.toggle(),
}, "◐");
Fclib.colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
