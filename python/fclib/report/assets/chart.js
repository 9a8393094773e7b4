// line charts and scatters in SVG, each with hover, keyboard, a table, and files to download
"use strict";
(() => {
  const { h, svg, number } = Fclib;
  const BOX = { left: 62, right: 16, top: 14, bottom: 46 };
  let WIDTH = 720, HEIGHT = 400;
  // letters keep their size on a phone: the picture gets narrower instead
  const measure = () => { [WIDTH, HEIGHT] = innerWidth < 600 ? [400, 330] : [720, 400]; };
  const DASHES = ["", "7 3", "2 2.5", "9 3 2 3", "12 4", "4 4"];
  Fclib.stroke = (k) => ({ colour: `var(--c${k % 7})`, dash: DASHES[Math.floor(k / 7) % DASHES.length] });
  Fclib.swatch = (k) => {
    const { colour, dash } = Fclib.stroke(k);
    return svg("svg", { width: 26, height: 8, "aria-hidden": true },
      svg("line", { x1: 0, x2: 26, y1: 4, y2: 4, stroke: colour, "stroke-width": 2.5, "stroke-dasharray": dash }));
  };

  // ---- axes
  const linearTicks = (low, high) => {
    const step0 = (high - low) / (WIDTH < 600 ? 4 : 6) || 1, power = 10 ** Math.floor(Math.log10(step0));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= step0 * 0.999);
    const ticks = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high * (1 + 1e-9) + 1e-12; k++) ticks.push(Number((k * step).toPrecision(12)));
    return ticks;
  };
  const logTicks = (low, high) => {
    const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
    if (last - first < 2) {
      const ticks = [];
      for (let p = Math.floor(Math.log10(low)); p <= last + 1; p++) for (const k of [1, 2, 5]) {
        const tick = Number((k * 10 ** p).toPrecision(3));
        if (tick >= low * 0.999 && tick <= high * 1.001) ticks.push(tick);
      }
      return ticks;
    }
    const step = Math.ceil((last - first) / (WIDTH < 600 ? 4 : 8)), ticks = [];
    for (let p = first; p <= last; p += step) ticks.push(Number(`1e${p}`));
    return ticks;
  };
  const scale = (log, low, high, from, to) => {
    if (log) { const a = Math.log10(low), b = Math.log10(high) - a || 1; return (x) => from + (Math.log10(x) - a) / b * (to - from); }
    return (x) => from + (x - low) / (high - low || 1) * (to - from);
  };
  const label = (tick) => number(tick, 3);

  const frame = (options, x, y) => {
    const ticksX = options.xlog ? logTicks(...options.xrange) : linearTicks(...options.xrange);
    const ticksY = options.ylog ? logTicks(...options.yrange) : linearTicks(...options.yrange);
    const bottom = HEIGHT - BOX.bottom, right = WIDTH - BOX.right;
    const text = { fill: "var(--soft)", "font-size": 13 };
    return svg("g", { "font-family": "system-ui, sans-serif" },
      ticksX.map((t) => [
        svg("line", { x1: x(t), x2: x(t), y1: BOX.top, y2: bottom, stroke: "var(--line)", "stroke-width": 0.7 }),
        svg("text", { ...text, x: x(t), y: bottom + 17, "text-anchor": "middle" }, label(t))]),
      ticksY.map((t) => [
        svg("line", { x1: BOX.left, x2: right, y1: y(t), y2: y(t), stroke: "var(--line)", "stroke-width": 0.7 }),
        svg("text", { ...text, x: BOX.left - 7, y: y(t) + 4, "text-anchor": "end" }, options.ypercent ? `${Math.round(100 * t)} %` : label(t))]),
      svg("path", { d: `M${BOX.left},${BOX.top}V${bottom}H${right}`, fill: "none", stroke: "var(--soft)" }),
      svg("text", { ...text, x: (BOX.left + right) / 2, y: HEIGHT - 8, "text-anchor": "middle" }, options.xlabel),
      svg("text", { ...text, x: 0, y: 0, transform: `translate(14 ${(BOX.top + bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, options.ylabel));
  };

  // ---- files
  const standalone = (element) => {
    const style = getComputedStyle(document.documentElement);
    const copy = element.cloneNode(true);
    copy.querySelectorAll(".cursor").forEach((node) => node.remove());
    copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
    copy.setAttribute("width", copy.viewBox.baseVal.width);
    copy.setAttribute("height", copy.viewBox.baseVal.height);
    copy.prepend(svg("rect", { width: "100%", height: "100%", fill: "var(--back)" }));
    return new XMLSerializer().serializeToString(copy).replace(/var\(--([\w-]+)\)/g, (_, name) => style.getPropertyValue(`--${name}`).trim());
  };
  const savePng = (name, element) => {
    const image = new Image();
    image.onload = () => {
      const canvas = h("canvas", { width: 2 * element.viewBox.baseVal.width, height: 2 * element.viewBox.baseVal.height });
      canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
      canvas.toBlob((blob) => {
        const url = URL.createObjectURL(blob);
        const link = h("a", { href: url, download: `${name}.png` });
        document.body.append(link); link.click(); link.remove();
        setTimeout(() => URL.revokeObjectURL(url), 1000);
      });
    };
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(standalone(element))}`;
  };
  // the file's legend goes below the axes, in as many columns as fit
  const legend = (series, width, height) => {
    const columns = Math.floor(width / 180), wide = (width - 20) / columns;
    return svg("g", { class: "inner-legend", "font-family": "system-ui, sans-serif" }, series.map((s, k) => {
      const { colour, dash } = Fclib.stroke(s.style ?? k);
      const x = 14 + (k % columns) * wide, y = height + 12 + 18 * Math.floor(k / columns);
      return [svg("line", { x1: x, x2: x + 26, y1: y, y2: y, stroke: colour, "stroke-width": 2.2, "stroke-dasharray": dash }),
        svg("text", { x: x + 32, y: y + 4, "font-size": 12, fill: "var(--text)" }, s.name)];
    }));
  };
  const tools = (name, element, columns, rows, series) => h("div", { class: "tools" },
    [["SVG", () => Fclib.saveText(`${name}.svg`, standalone(withLegend(element, series)), "image/svg+xml")],
      ["PNG", () => savePng(name, withLegend(element, series))],
      ["CSV", () => Fclib.saveText(`${name}.csv`, Fclib.csv(columns(), rows()), "text/csv")]].map(([what, act]) =>
      h("button", { type: "button", onclick: act, "aria-label": `Download ${name} as ${what}` }, `↓ ${what}`)));
  const withLegend = (element, series) => {
    if (!series) return element;
    const copy = element.cloneNode(true);
    const { width, height } = element.viewBox.baseVal;
    copy.setAttribute("viewBox", `0 0 ${width} ${height + 10 + 18 * Math.ceil(series.length / Math.floor(width / 180))}`);
    copy.append(legend(series, width, height));
    return copy;
  };
  const tableBelow = (columns, rows, caption) => {
    const box = h("details", {}, h("summary", {}, "The numbers as a table"));
    box.addEventListener("toggle", () => {
      if (box.open && box.children.length === 1) {
        const all = rows();
        box.append(Fclib.table({
          caption, columns: columns().map((key, k) => ({ key: k, label: key })), rows: all, page: 25,
        }));
      }
    });
    return box;
  };

  // the value of a step function, or the nearest value at or before x
  const at = (s, x) => {
    let low = 0, high = s.x.length;
    while (low < high) { const mid = (low + high) >> 1; if (s.x[mid] <= x) low = mid + 1; else high = mid; }
    return low ? s.y[low - 1] : null;
  };

  /* options: name, title, series [{name, x, y, style}], xlog, ylog, xrange, yrange, xlabel, ylabel, ypercent,
     step: values hold until the next x */
  Fclib.lines = (options) => {
    measure();
    const { series } = options;
    const x = scale(options.xlog, ...options.xrange, BOX.left, WIDTH - BOX.right);
    const y = scale(options.ylog, ...options.yrange, HEIGHT - BOX.bottom, BOX.top);
    const paths = series.map((s, k) => {
      const { colour, dash } = Fclib.stroke(s.style ?? k);
      let d = "", before = null;
      for (let i = 0; i < s.x.length; i++) {
        if (s.y[i] === null || (options.ylog && s.y[i] <= 0)) continue;
        const px = x(Math.min(Math.max(s.x[i], options.xrange[0]), options.xrange[1])), py = y(Math.min(Math.max(s.y[i], options.yrange[0]), options.yrange[1]));
        if (s.x[i] > options.xrange[1]) { d += options.step ? `H${(WIDTH - BOX.right).toFixed(1)}` : ""; before = null; break; }
        d += before === null && d === "" ? `M${px.toFixed(1)},${py.toFixed(1)}` : options.step ? `H${px.toFixed(1)}V${py.toFixed(1)}` : `L${px.toFixed(1)},${py.toFixed(1)}`;
        before = py;
      }
      if (options.step && before !== null) d += `H${WIDTH - BOX.right}`;
      return svg("path", { d, fill: "none", stroke: colour, "stroke-width": 2, "stroke-dasharray": dash, "stroke-linejoin": "round", "data-name": s.name });
    });
    const cursor = svg("line", { class: "cursor", y1: BOX.top, y2: HEIGHT - BOX.bottom, stroke: "var(--accent)", visibility: "hidden" });
    const picture = svg("svg", {
      viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", tabindex: 0,
      "aria-label": `${options.title}. ${series.length} curves. Left and right arrows read values; a table follows.`,
    }, frame(options, x, y), paths, cursor);
    const tip = h("div", { class: "tip", hidden: true, role: "status" });
    const chart = h("div", { class: "chart" }, picture, tip), width = WIDTH;
    let place = 0.5;
    const show = (share) => {
      place = Math.min(1, Math.max(0, share));
      const [low, high] = options.xrange;
      const value = options.xlog ? low * (high / low) ** place : low + (high - low) * place;
      const px = BOX.left + place * (width - BOX.left - BOX.right);
      Fclib.set(cursor, { x1: px, x2: px });
      cursor.setAttribute("visibility", "visible");
      const found = series.map((s, k) => [s, at(s, value), k]).filter(([, v]) => v !== null).sort((a, b) => options.ylog ? a[1] - b[1] : b[1] - a[1]);
      tip.replaceChildren(h("b", {}, `${options.xname || "x"} = ${number(value)}`), ...found.slice(0, 14).map(([s, v, k]) =>
        h("div", {}, h("span", {}, Fclib.swatch(s.style ?? k), ` ${s.name}`), h("span", {}, options.ypercent ? Fclib.percent(v) : number(v)))));
      tip.hidden = false;
      const left = px / width * chart.clientWidth;
      tip.style.left = left > chart.clientWidth / 2 ? "" : `${left + 10}px`;
      tip.style.right = left > chart.clientWidth / 2 ? `${chart.clientWidth - left + 10}px` : "";
      tip.style.top = "6px";
    };
    const hide = () => { tip.hidden = true; cursor.setAttribute("visibility", "hidden"); };
    picture.addEventListener("pointermove", (event) => {
      const box = picture.getBoundingClientRect();
      show(((event.clientX - box.left) / box.width * width - BOX.left) / (width - BOX.left - BOX.right));
    });
    picture.addEventListener("pointerleave", hide);
    picture.addEventListener("blur", hide);
    picture.addEventListener("keydown", (event) => {
      if (event.key === "ArrowLeft" || event.key === "ArrowRight") {
        event.preventDefault();
        show(place + (event.key === "ArrowLeft" ? -0.02 : 0.02));
      } else if (event.key === "Escape") hide();
    });
    const columns = () => [options.xname || "x", ...series.map((s) => s.name)];
    const rows = () => {
      const all = [...new Set(series.flatMap((s) => s.x))].sort((a, b) => a - b);
      return all.map((value) => [value, ...series.map((s) => at(s, value))]);
    };
    return h("figure", {}, chart,
      h("ul", { class: "legend", "aria-label": "Curves" }, series.map((s, k) => h("li", {}, Fclib.swatch(s.style ?? k), s.name))),
      options.note && h("figcaption", {}, options.note),
      tools(options.name, picture, columns, rows, series), tableBelow(columns, rows, options.title));
  };

  /* options: name, title, points [{x, y, label, href, group, failed}], groups, range, xlabel, ylabel */
  Fclib.scatter = (options) => {
    measure();
    const x = scale(true, ...options.range, BOX.left, WIDTH - BOX.right - 24);
    const y = scale(true, ...options.range, HEIGHT - BOX.bottom, BOX.top + 24);
    const [low, high] = options.range;
    const own = { ...options, xlog: true, ylog: true, xrange: options.range, yrange: options.range };
    const end = { x: WIDTH - BOX.right - 8, y: BOX.top + 8 };
    const marks = options.points.map((p) => svg("a", { href: p.href, "data-label": p.label, tabindex: -1 },
      svg("circle", {
        cx: p.x === null ? end.x : x(p.x), cy: p.y === null ? end.y : y(p.y), r: 4.2,
        fill: `var(--c${p.group % 7})`, "fill-opacity": 0.65, stroke: `var(--c${p.group % 7})`,
      }, svg("title", {}, p.label))));
    const text = { fill: "var(--soft)", "font-size": 12 };
    const picture = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "group", "aria-label": `${options.title}. ${options.points.length} problems; a table follows.` },
      frame(own, x, y),
      svg("line", { x1: x(low), y1: y(low), x2: x(high), y2: y(high), stroke: "var(--soft)", "stroke-dasharray": "4 4" }),
      svg("line", { x1: BOX.left, x2: end.x, y1: end.y + 9, y2: end.y + 9, stroke: "var(--line)" }),
      svg("line", { x1: end.x - 9, x2: end.x - 9, y1: end.y, y2: HEIGHT - BOX.bottom, stroke: "var(--line)" }),
      svg("text", { ...text, x: BOX.left + 6, y: end.y + 3 }, "failed ↑"),
      svg("text", { ...text, x: end.x - 12, y: HEIGHT - BOX.bottom - 8, "text-anchor": "end" }, "failed →"),
      marks);
    const tip = h("div", { class: "tip", hidden: true });
    const chart = h("div", { class: "chart" }, picture, tip);
    picture.addEventListener("pointerover", (event) => {
      const link = event.target.closest("a");
      tip.hidden = !link;
      if (!link) return;
      const box = chart.getBoundingClientRect(), left = event.clientX - box.left;
      tip.textContent = link.dataset.label;
      tip.style.left = left < box.width / 2 ? `${left + 12}px` : "";
      tip.style.right = left < box.width / 2 ? "" : `${box.width - left + 12}px`;
      tip.style.top = `${event.clientY - box.top - 10}px`;
    });
    picture.addEventListener("pointerleave", () => { tip.hidden = true; });
    const columns = () => ["problem", options.xname, options.yname, "family"];
    const rows = () => options.points.map((p) => [p.problem, p.x, p.y, options.groups[p.group]]);
    const table = h("details", {}, h("summary", {}, "The numbers as a table, each problem with its page"));
    table.addEventListener("toggle", () => {
      if (table.open && table.children.length === 1) table.append(Fclib.table({
        caption: options.title, page: 25, rows: options.points,
        columns: [
          { key: "problem", label: "problem", head: true, cell: (p) => h("a", { href: p.href }, p.problem) },
          { key: "x", label: options.xname, type: "number" }, { key: "y", label: options.yname, type: "number" },
          { key: "ratio", label: "ratio", type: "number", value: (p) => p.x && p.y ? p.x / p.y : null },
        ],
      }));
    });
    return h("figure", {}, chart,
      h("ul", { class: "legend" }, options.groups.map((name, k) => h("li", {}, h("span", { class: "key", style: `background: var(--c${k % 7})` }), name))),
      options.note && h("figcaption", {}, options.note),
      tools(options.name, picture, columns, rows), table);
  };
})();
