// a figure for a paper: curves of steps as SVG, PGF or a page to print as PDF, one or two columns
// wide, with a caption for LaTeX and the BibTeX of what it is of. Python draws the same by
// `fclib profile --figure`.
"use strict";
(() => {
  const { h, copyable } = Fclib;
  const MM = 72 / 25.4; // a unit is a point
  const WIDTHS = { 1: 84 * MM, 2: 174 * MM };
  const HEIGHT = 52 * MM; // without the legend
  const SIZE = 8; // of letters
  const FONTS = { sans: "Helvetica, Arial, sans-serif", serif: "Times, 'Times New Roman', serif" };
  const INK = "#000000";
  const GRID = "#d0d0d0";
  const MARKS = 8; // of a curve
  // strokes and pauses, in the order of those of Fclib.stroke
  const DASHES = [[], [6, 2], [1.3, 1.3], [7, 2, 1.3, 2]];

  /* the corners of marks of radius 1, in the order of Fclib.SYMBOLS */
  const around = (n, turn, radius = () => 1) =>
    [...Array(n)].map((_, k) => {
      const angle = turn + (2 * Math.PI * k) / n;
      return [radius(k) * Math.sin(angle), -radius(k) * Math.cos(angle)];
    });
  const up = 0;
  const plus = (turn) => around(12, turn, (k) => (k % 3 === 0 ? 0.45 : 1)); // of three bars an arm
  const SHAPES = [
    around(24, up),
    around(4, Math.PI / 4, () => 1.2),
    around(4, up, () => 1.3),
    plus(Math.PI / 4),
    plus(0),
    around(3, up),
    around(3, Math.PI),
    around(10, up, (k) => (k % 2 ? 0.4 : 1.1)),
    around(6, up),
    around(5, up),
  ];

  /* a text as LaTeX prints it; latex_text() of fclib/bench/plots.py is the same */
  const escaped = (text) =>
    text.replace(
      /[\\&%$#_{}^~<>|τ×]/g,
      (c) =>
        ({
          "\\": "\\textbackslash{}",
          "^": "\\textasciicircum{}",
          "~": "\\textasciitilde{}",
          "<": "\\textless{}",
          ">": "\\textgreater{}",
          "|": "\\textbar{}",
          τ: "$\\tau$",
          "×": "$\\times$",
        })[c] || `\\${c}`,
    );
  Fclib.escaped = escaped;
  const round = (v) => String(Math.round(v * 100) / 100);

  /* pens: line(points, {colour, width, dash}), shape(points, colour),
     text(x, y, text, {anchor, turned, power}); whole() is the text of the file */
  const svgPen = (width, height, font, ink) => {
    const parts = [];
    const clean = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;");
    const points = (list) => list.map(([x, y]) => `${round(x)},${round(y)}`).join(" ");
    return {
      line: (list, { colour, width: w, dash = [] }) =>
        parts.push(
          `<polyline points="${points(list)}" fill="none" stroke="${colour}" stroke-width="${w}"` +
            `${dash.length ? ` stroke-dasharray="${dash.join(" ")}"` : ""}/>`,
        ),
      shape: (list, colour, opacity = 1) =>
        parts.push(
          `<polygon points="${points(list)}" fill="${colour}"` +
            `${opacity < 1 ? ` fill-opacity="${opacity}"` : ""}/>`,
        ),
      text: (x, y, text, { anchor = "start", turned, power } = {}) =>
        parts.push(
          `<text x="${round(x)}" y="${round(y)}" text-anchor="${anchor}"` +
            `${turned ? ` transform="rotate(-90 ${round(x)} ${round(y)})"` : ""}>${clean(text)}` +
            `${power ? `<tspan dy="-3" font-size="${0.7 * SIZE}">${power}</tspan>` : ""}</text>`,
        ),
      whole: () =>
        `<svg xmlns="http://www.w3.org/2000/svg" width="${round(width)}pt" ` +
        `height="${round(height)}pt" viewBox="0 0 ${round(width)} ${round(height)}" ` +
        `font-family="${FONTS[font]}" font-size="${SIZE}" fill="${ink}">\n` +
        `${parts.join("\n")}\n</svg>\n`,
    };
  };
  const pgfPen = (width, height, font) => {
    const parts = [];
    const at = ([x, y]) => `\\pgfqpoint{${round(x)}bp}{${round(height - y)}bp}`;
    const path = (list) =>
      list.map((p, k) => `\\pgfpath${k ? "lineto" : "moveto"}{${at(p)}}`).join("%\n");
    const inked = (colour) => `\\definecolor{fclib}{HTML}{${colour.slice(1)}}\\pgfsetcolor{fclib}%`;
    return {
      line: (list, { colour, width: w, dash = [] }) =>
        parts.push(
          inked(colour),
          `\\pgfsetlinewidth{${w}bp}\\pgfsetdash{${dash.map((v) => `{${v}bp}`).join("")}}{0bp}%`,
          `${path(list)}\\pgfusepath{stroke}%`,
        ),
      shape: (list, colour) =>
        parts.push(inked(colour), `${path(list)}\\pgfpathclose\\pgfusepath{fill}%`),
      text: (x, y, text, { anchor = "start", turned, power } = {}) => {
        const side = { start: "left,", end: "right,", middle: "" }[anchor];
        const words = power ? `$${text}^{${power}}$` : escaped(text);
        parts.push(
          inked(INK),
          `\\pgftext[x=${round(x)}bp,y=${round(height - y)}bp,${side}base` +
            `${turned ? ",rotate=90" : ""}]` +
            `{\\fontsize{${SIZE}}{${1.2 * SIZE}}\\selectfont ${words}}%`,
        );
      },
      whole: () =>
        [
          "\\begingroup%",
          font === "sans" ? "\\sffamily%" : "\\rmfamily%",
          "\\begin{pgfpicture}%",
          `\\pgfpathrectangle{\\pgfpointorigin}{\\pgfqpoint{${round(width)}bp}` +
            `{${round(height)}bp}}\\pgfusepath{use as bounding box}%`,
          ...parts,
          "\\end{pgfpicture}%",
          "\\endgroup%",
          "",
        ].join("\n"),
    };
  };

  /* where an axis has marks: [{v, text, power}] */
  const ticksOf = ([low, high], isLog) => {
    if (!isLog) {
      const rough = (high - low) / 5;
      const unit = 10 ** Math.floor(Math.log10(rough));
      const step = unit * [1, 2, 5, 10].find((f) => f * unit >= rough);
      const first = Math.ceil(low / step - 1e-9);
      const count = Math.floor(high / step + 1e-9) - first + 1;
      return [...Array(count)].map((_, k) => {
        const v = (first + k) * step;
        return { v, text: String(Number(v.toPrecision(6))) };
      });
    }
    const exponents = [...Array(Math.floor(Math.log10(high) + 1e-9) + 20)].map((_, k) => k - 19);
    const inside = (v) => v >= low * 0.999 && v <= high * 1.001;
    const decades = exponents.filter((e) => inside(10 ** e));
    if (decades.length > 1)
      return decades
        .filter((_, k) => k % Math.ceil(decades.length / 8) === 0)
        .map((e) => ({ v: 10 ** e, text: "10", power: String(e || "0") }));
    return exponents
      .concat(Math.floor(Math.log10(high)) + 1)
      .flatMap((e) => [1, 2, 3, 5].map((f) => f * 10 ** e))
      .filter(inside)
      .map((v) => ({ v, text: String(Number(v.toPrecision(3))) }));
  };

  /* options: series [{legend, x, y, style, band: [low, high]}] of steps, colours, xlog, xrange,
     xlabel, ylabel; whole: its height, or that of a figure for a paper */
  Fclib.draw = (
    options,
    { format, columns, font, width = WIDTHS[columns], whole, ink = INK, grid = GRID },
  ) => {
    const { series, xlog, xrange, xlabel, ylabel } = options;
    const longest = Math.max(...series.map((s) => s.legend.length));
    const across = Math.max(
      1,
      Math.min(series.length, Math.floor((width - 20) / (34 + 4.4 * longest))),
    );
    const lines = Math.ceil(series.length / across);
    const legend = 11 * lines + 3;
    const height = whole || HEIGHT + legend;
    const above = height - legend; // of the curves and the axis
    const pen = (format === "pgf" ? pgfPen : svgPen)(width, height, font, ink);
    const [left, right, top, bottom] = [options.ypercent ? 44 : 34, width - 8, 6, above - 28];
    const scale = (v) => (xlog ? Math.log10(v) : v);
    const [low, high] = xrange.map(scale);
    const px = (v) => left + ((scale(v) - low) / (high - low)) * (right - left);
    const py = (share) => bottom - (share / 1.02) * (bottom - top);
    const thin = { colour: grid, width: 0.3 };
    for (const { v, text, power } of ticksOf(xrange, xlog)) {
      pen.line(
        [
          [px(v), top],
          [px(v), bottom],
        ],
        thin,
      );
      pen.text(px(v), bottom + 10, text, { anchor: "middle", power });
    }
    for (const share of [0, 0.2, 0.4, 0.6, 0.8, 1]) {
      pen.line(
        [
          [left, py(share)],
          [right, py(share)],
        ],
        thin,
      );
      const text = options.ypercent ? `${100 * share} %` : share.toFixed(1);
      pen.text(left - 4, py(share) + 3, text, { anchor: "end" });
    }
    pen.line(
      [
        [left, top],
        [left, bottom],
        [right, bottom],
      ],
      { colour: ink, width: 0.6 },
    );
    pen.text((left + right) / 2, bottom + 22, xlabel, { anchor: "middle" });
    pen.text(10, (top + bottom) / 2, ylabel, { anchor: "middle", turned: true });
    const look = (s) => ({
      colour: options.colours[s.style % options.colours.length],
      width: 1.3,
      dash: DASHES[s.style % DASHES.length],
    });
    const mark = (s, x, y) =>
      pen.shape(
        SHAPES[s.style % SHAPES.length].map(([dx, dy]) => [x + 2.4 * dx, y + 2.4 * dy]),
        look(s).colour,
      );
    const corners = (x, y) => {
      const shown = x
        .map((v, k) => [v, y[k]])
        .filter(([v, share]) => share !== null && v <= xrange[1]);
      const found = shown.flatMap(([v, share], k) =>
        k
          ? [
              [px(v), py(shown[k - 1][1])],
              [px(v), py(share)],
            ]
          : [[px(v), py(share)]],
      );
      if (found.length) found.push([right, found[found.length - 1][1]]);
      return found;
    };
    for (const s of series.filter((one) => one.band)) {
      const [under, over] = s.band.map((y) => corners(s.x, y));
      pen.shape([...under, ...over.reverse()], look(s).colour, 0.15);
    }
    series.forEach((s, place) => {
      pen.line(corners(s.x, s.y), look(s));
      for (let k = 0; k < MARKS; k++) {
        const t = (k + 0.2 + 0.6 * ((place % 4) / 4)) / MARKS;
        const v = xlog ? 10 ** (low + t * (high - low)) : low + t * (high - low);
        const share = Fclib.at(s, v);
        if (share !== null) mark(s, px(v), py(share));
      }
    });
    series.forEach((s, k) => {
      const x = left + (k % across) * ((right - left) / across);
      const y = above + 7 + 11 * Math.floor(k / across);
      pen.line(
        [
          [x, y],
          [x + 24, y],
        ],
        look(s),
      );
      mark(s, x + 12, y);
      pen.text(x + 29, y + 2.8, s.legend);
    });
    return { text: pen.whole(), width, height };
  };

  /* curves on a page: in the colours of its theme, as large as a place of so many pixels */
  Fclib.sketch = (options, [width, height]) => {
    const unit = 13 / SIZE; // pixels, so that letters are as large as those of the page
    const series = options.series.map((s, k) => ({
      ...s,
      legend: s.legend || s.name,
      style: s.style ?? k,
    }));
    const { text } = Fclib.draw(
      { ...options, series, colours: [...Array(7)].map((_, k) => `var(--c${k})`) },
      {
        font: "sans",
        width: width / unit,
        whole: height / unit,
        ink: "var(--text)",
        grid: "var(--line)",
      },
    );
    const drawn = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
    Fclib.set(drawn, { width: "100%", height: "100%", "aria-hidden": "true" });
    drawn.removeAttribute("font-family");
    return drawn;
  };
  /* the figure in LaTeX: cites [[name, [BibTeX]]] */
  const environment = (name, { columns, format }, { title, words, cites }) => {
    const kind = columns === 2 ? "figure*" : "figure";
    const key = (entry) => /\{\s*([^,\s]+)/.exec(entry)[1];
    const named = cites.map(([one, list]) => `${escaped(one)}~\\cite{${list.map(key).join(",")}}`);
    return [
      `\\begin{${kind}}`,
      "  \\centering",
      format === "pgf" ? `  \\input{${name}.pgf}` : `  \\includegraphics{${name}}`,
      `  \\caption{${title}: ${escaped(words.filter(Boolean).join("; "))}. ${named.join(", ")}.}`,
      `  \\label{fig:${name}}`,
      `\\end{${kind}}`,
    ].join("\n");
  };
  const saveAs = (name, text) => {
    const href = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
    h("a", { href, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(href), 1000);
  };
  /* a page as large as the figure, which the browser prints into a PDF */
  const print = ({ text, width, height }) => {
    const frame = h("iframe", {
      class: "unseen",
      title: "the figure to print",
      srcdoc:
        `<!doctype html><title>figure</title><style>@page { size: ${width}pt ${height}pt; ` +
        `margin: 0 } body { margin: 0 } svg { display: block }</style>${text}`,
      onload: () => {
        frame.contentWindow.addEventListener("afterprint", () => frame.remove());
        frame.contentWindow.print();
      },
    });
    document.body.append(frame);
  };

  /* what asks for width and font, and gives the files; options: name, and those of draw;
     caption {title, words, cites} */
  Fclib.paper = (options, caption) => {
    const name = options.name.replaceAll(/[^\w.-]+/g, "-");
    const chosen = { columns: 1, font: "sans", format: "pdf" };
    const latex = h("div", {});
    const bibtex = [...new Set(caption.cites.flatMap(([, list]) => list))].join("\n\n");
    const fill = () =>
      latex.replaceChildren(copyable(environment(name, chosen, caption), "the caption"));
    const pick = (label, key, entries, read = (v) => v) =>
      Fclib.parts.select(label, entries, chosen[key], (value) => {
        chosen[key] = read(value);
        fill();
      });
    const give = {
      pdf: (one) => print(one),
      svg: (one) => saveAs(`${name}.svg`, one.text),
      pgf: (one) => saveAs(`${name}.pgf`, one.text),
    };
    fill();
    return h(
      "details",
      { class: "paper" },
      h("summary", {}, "A figure for a paper"),
      h(
        "div",
        { class: "controls" },
        pick(
          "width",
          "columns",
          [
            ["1", "one column"],
            ["2", "two columns"],
          ],
          Number,
        ),
        pick("font", "font", [
          ["sans", "without serifs"],
          ["serif", "with serifs"],
        ]),
        ...Object.keys(give).map((format) =>
          h(
            "button",
            {
              type: "button",
              "aria-label": `The figure as ${format.toUpperCase()}`,
              onclick: () => {
                chosen.format = format;
                fill();
                give[format](Fclib.draw(options, chosen));
              },
            },
            `↓ ${format.toUpperCase()}`,
          ),
        ),
      ),
      h(
        "p",
        { class: "small soft" },
        "For the PDF the browser prints a page as large as the figure: choose “Save as PDF”.",
      ),
      latex,
      h("details", {}, h("summary", {}, "BibTeX of what it cites"), copyable(bibtex, "BibTeX")),
    );
  };
})();
