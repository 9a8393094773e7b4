// pictures, drawn when they come in sight; each with keys, a table of its numbers, and files to
// keep. Plotly draws them. To load and to run it costs a second, so curves of a profile are first
// drawn without it, until a person turns to them.
"use strict";
(() => {
  const { h, number, colour } = Fclib;
  // curves differ in print without colours; fclib.bench.plots has the same strokes
  const DASHES = ["solid", "dash", "dot", "dashdot"];
  const BANDED = 6; // curves with a band: more hide each other
  const FEWEST = 1000; // values of x up to which each is drawn
  Fclib.stroke = (k) => ({
    color: colour(`c${k % 7}`),
    dash: DASHES[k % DASHES.length],
  });
  Fclib.swatch = (k) =>
    h("span", {
      class: "swatch",
      "aria-hidden": true,
      "data-symbol": "●■◆✚✖▲▼★⬢⬟"[k % 10],
      style:
        `color: var(--c${k % 7}); border-top: 3px ` +
        `${["solid", "dashed", "dotted", "double"][k % 4]}`,
    });
  // the buttons of a chart and of a picture in space: these and no others, none that sends data;
  // none for fingers
  Fclib.BUTTONS = {
    plane: [
      ["zoom2d", "pan2d"],
      ["zoomIn2d", "zoomOut2d", "resetScale2d"],
    ],
    space: [["orbitRotation", "pan3d"], ["resetCameraDefault3d"]],
  };
  Fclib.isTouched = () => matchMedia("(pointer: coarse)").matches;
  Fclib.SYMBOLS = [
    "circle",
    "square",
    "diamond",
    "cross",
    "x",
    "triangle-up",
    "triangle-down",
    "star",
    "hexagon",
    "pentagon",
  ];
  Fclib.isNarrow = () => innerWidth < 600;

  /* the value at x of steps: that of the last of them at or before x */
  Fclib.at = (steps, x) => {
    let low = 0;
    let high = steps.x.length;
    while (low < high) {
      const mid = (low + high) >> 1;
      if (steps.x[mid] <= x) low = mid + 1;
      else high = mid;
    }
    return low ? steps.y[low - 1] : null;
  };

  const look = () => {
    const axis = {
      gridcolor: colour("line"),
      linecolor: colour("soft"),
      color: colour("soft"),
      zeroline: false,
      showline: true,
      exponentformat: "power",
      automargin: true,
    };
    const solid = { ...axis, showbackground: false, showspikes: false };
    return {
      layout: {
        font: { family: "system-ui, sans-serif", size: 13, color: colour("text") },
        colorway: [...Array(7)].map((_, k) => colour(`c${k}`)),
        paper_bgcolor: colour("back"),
        plot_bgcolor: colour("back"),
        margin: { l: 62, r: 14, t: 12, b: 58 },
        xaxis: { ...axis, title: { standoff: 10 } },
        yaxis: axis,
        scene: { xaxis: solid, yaxis: solid, zaxis: solid },
        hoverlabel: {
          bgcolor: colour("back"),
          bordercolor: colour("line"),
          font: { color: colour("text"), size: 12.5 },
        },
        legend: {
          orientation: "h",
          yref: "container",
          y: 0,
          yanchor: "bottom",
          font: { size: 12 },
          itemwidth: 30,
        },
      },
    };
  };

  /* options: name, title, draw(width) -> {data, layout}, height, says: what it holds and which
     keys it knows, keys: {key: act(box)}, href(point), table() -> element, below: controls, note,
     still: no tools and no table, first(width, height): a drawing that needs no library
     The box has data-shown if anything is drawn, and data-drawn if Plotly has drawn it. */
  Fclib.plot = (options) => {
    const { title } = options;
    const name = options.name.replaceAll("/", "-");
    const box = h("div", {
      class: "plot",
      tabindex: 0,
      role: options.still ? "img" : "application",
      "aria-label": [`${title}.`, options.says, options.still ? null : "A table follows."]
        .filter(Boolean)
        .join(" "),
      style: `height: ${options.height || 400}px`,
    });
    const heard = h("p", { class: "unseen", role: "status" });
    box.say = (text) => {
      heard.textContent = text;
    };
    box.draw = async () => {
      const Plotly = await Fclib.plotly();
      if (!box.isConnected) return;
      const { data, layout } = options.draw(box.clientWidth);
      if (!box.dataset.drawn) box.replaceChildren(); // without the first drawing
      await Plotly.react(
        box,
        data,
        { template: look(), uirevision: "kept", ...layout },
        {
          responsive: true,
          displaylogo: false,
          scrollZoom: "gl3d",
          displayModeBar: options.still || Fclib.isTouched() ? false : "hover",
          modeBarButtons: Fclib.BUTTONS[options.space ? "space" : "plane"],
          plotlyServerURL: "",
          topojsonURL: "none:",
        },
      );
      if (options.href && !box.dataset.drawn)
        box.on("plotly_click", ({ points: [point] }) => {
          location.hash = options.href(point);
        });
      box.dataset.drawn = data.length;
      box.dataset.shown = "";
    };
    const isSketched = () => options.first && !window.Plotly;
    const sketch = () => {
      box.replaceChildren(options.first(box.clientWidth, box.clientHeight));
      box.dataset.shown = "";
    };
    const show = () => {
      if (!isSketched()) return box.draw();
      sketch();
      const turned = ["pointerenter", "focus"];
      const draw = () => {
        turned.forEach((kind) => box.removeEventListener(kind, draw));
        return box.draw();
      };
      turned.forEach((kind) => box.addEventListener(kind, draw));
      return null;
    };
    new IntersectionObserver(
      (seen, watcher) => {
        if (!seen.some((one) => one.isIntersecting)) return;
        watcher.disconnect();
        show();
      },
      { rootMargin: "300px" },
    ).observe(box);
    document.addEventListener("fclib-theme", () => {
      if (box.dataset.drawn && box.isConnected) box.draw();
    });
    // on paper are all charts, also those that were not in sight
    document.addEventListener("fclib-print", async () => {
      if (!box.isConnected || !box.clientWidth) return;
      if (isSketched()) {
        sketch();
        return;
      }
      await box.draw();
      await window.Plotly.relayout(box, { autosize: true });
    });
    if (!options.first) (window.requestIdleCallback || setTimeout)(Fclib.plotly);
    box.addEventListener("keydown", async (event) => {
      const act = options.keys && options.keys[event.key];
      if (!act || !("shown" in box.dataset)) return;
      event.preventDefault();
      if (!box.dataset.drawn) await box.draw();
      if (box.dataset.drawn) act(box);
    });
    const figure = (...parts) => Object.assign(h("figure", {}, ...parts), { plot: box });
    if (options.still) return figure(box, options.note && h("figcaption", {}, options.note));
    const table = h("details", {}, h("summary", {}, "The numbers as a table"));
    const fill = () => {
      if (table.children.length === 1) table.append(options.table());
      return table.lastChild;
    };
    table.addEventListener("toggle", fill);
    const saved = async (format) => {
      if (!box.dataset.drawn) await box.draw();
      const Plotly = await Fclib.plotly();
      if (!box.isConnected) return null;
      return Plotly.downloadImage(box, {
        format,
        filename: name,
        width: box.clientWidth,
        height: box.clientHeight,
        scale: format === "png" ? 2 : 1,
      });
    };
    // one picture after another
    const save = (format) => {
      Fclib.saving = (Fclib.saving || Promise.resolve()).then(
        () => saved(format),
        () => saved(format),
      );
      return Fclib.saving;
    };
    const tools = [
      ["SVG", () => save("svg")],
      ["PNG", () => save("png")],
      ["CSV", () => fill().api.button(0).trigger()],
    ];
    return figure(
      box,
      heard,
      options.note && h("figcaption", {}, options.note),
      options.below,
      h(
        "div",
        { class: "tools" },
        tools.map(([what, act]) =>
          h(
            "button",
            { type: "button", onclick: act, "aria-label": `Download ${name} as ${what}` },
            `↓ ${what}`,
          ),
        ),
      ),
      table,
    );
  };

  /* curves, all at the same x: where one of them changes, or at so many x that no eye sees the
     difference
     options: series [{name, legend, x, y, style}] of steps, xlog, ylog, xrange, yrange, xlabel,
     ylabel, xname, ypercent, and those of a plot */
  Fclib.lines = (options) => {
    const {
      series,
      xlog,
      ylog,
      xrange: [low, high],
    } = options;
    const changes = new Set();
    for (const s of series)
      for (const v of s.x) if (v >= low && v <= high && changes.size <= FEWEST) changes.add(v);
    let x = [...changes].sort((a, b) => a - b);
    if (x.length > FEWEST)
      x = [...Array(FEWEST)].map((_, k) => {
        const t = k / (FEWEST - 1);
        return xlog ? low * (high / low) ** t : low + (high - low) * t;
      });
    else if (x[x.length - 1] < high && !options.ends) x.push(high);
    const curves = series.map((s) => ({ ...s, y: x.map((v) => Fclib.at(s, v)) }));
    const banded = curves
      .filter((s) => s.band)
      .slice(0, BANDED)
      .map((s) => [s, s.band.map((y) => x.map((v) => Fclib.at({ x: s.x, y }, v)))]);
    const own = () => {
      const bands = new Map(banded);
      return curves.map((s) => ({ ...s, x, band: bands.get(s) }));
    };
    const log = (range, on) => (on ? range.map(Math.log10) : range);
    // the legend: as many columns as the longest name leaves room for
    const longest = Math.max(...series.map((s) => (s.legend || s.name).length));
    const columnsIn = (width) =>
      Math.max(1, Math.min(series.length, Math.floor((width - 90) / (50 + 6.5 * longest))));
    const expected =
      options.half && innerWidth > 960 ? Math.min(innerWidth, 1200) / 2 : Math.min(innerWidth, 864);
    const rows = Math.ceil(series.length / columnsIn(expected));
    const few = series.length < 15;
    let place = -1;
    const read = (step) => (box) => {
      place = Math.min(
        x.length - 1,
        Math.max(0, place < 0 ? Math.floor(x.length / 2) : place + step),
      );
      const there = curves.map((s, k) => [s, k]).filter(([s]) => s.y[place] !== null);
      Plotly.Fx.hover(
        box,
        there.map(([, k]) => ({ curveNumber: k, pointNumber: place })),
      );
      const told = options.ypercent ? Fclib.percent : number;
      const values = there.map(([s]) => `${s.name}: ${told(s.y[place])}`);
      box.say(`${options.xname} = ${number(x[place])}; ${values.join("; ")}`);
    };
    const stride = Math.ceil(x.length / 60);
    return Fclib.plot({
      ...options,
      first: options.ypercent
        ? (...size) => Fclib.sketch({ ...options, series: own() }, size)
        : null,
      height: (Fclib.isNarrow() ? 330 : 400) + (series.length > 1 ? 20 * rows : 0),
      says: `${Fclib.count(series.length, "curve")}. Left and right arrows read values.`,
      keys: {
        ArrowLeft: read(-stride),
        ArrowRight: read(stride),
        Escape: (box) => {
          Plotly.Fx.unhover(box);
          box.say("");
        },
      },
      draw: (width) => ({
        data: [
          ...curves.map((s, k) => ({
            type: "scatter",
            mode: options.ends || series.length > 1 ? "lines+markers" : "lines",
            name: s.legend || s.name,
            x,
            y: s.y,
            line: {
              ...Fclib.stroke(s.style ?? k),
              width: 2,
              shape: options.ends ? "linear" : "hv",
            },
            ...(series.length > 1
              ? {
                  marker: {
                    symbol: Fclib.SYMBOLS[(s.style ?? k) % Fclib.SYMBOLS.length],
                    size: 8,
                    maxdisplayed: 9,
                  },
                }
              : {}),
            hovertemplate: few
              ? `%{y:${options.ypercent ? ".1%" : ".3~g"}}`
              : `%{fullData.name}: %{y:${options.ypercent ? ".1%" : ".3~g"}}<extra></extra>`,
          })),
          ...banded.flatMap(([s, band], k) =>
            band.map((y, side) => ({
              type: "scatter",
              mode: "lines",
              x,
              y,
              line: { width: 0, shape: "hv" },
              hoverinfo: "skip",
              showlegend: false,
              ...(side
                ? { fill: "tonexty", fillcolor: `${colour(`c${(s.style ?? k) % 7}`)}26` }
                : {}),
            })),
          ),
        ],
        layout: {
          hovermode: few ? "x unified" : "closest",
          hoverdistance: 40,
          hoversort: ylog ? "value ascending" : "value descending",
          showlegend: series.length > 1,
          legend: {
            entrywidth: 0.98 / columnsIn(width),
            entrywidthmode: "fraction",
            traceorder: "normal",
          },
          xaxis: {
            type: xlog ? "log" : "linear",
            range: log([low, high], xlog),
            title: { text: options.xlabel },
            unifiedhovertitle: { text: `${options.xname} = %{x:.3~g}` },
          },
          yaxis: {
            type: ylog ? "log" : "linear",
            range: log(options.yrange, ylog),
            title: { text: options.ylabel },
            tickformat: options.ypercent ? ".0%" : undefined,
          },
        },
      }),
      table: () =>
        Fclib.table({
          caption: options.title,
          name: options.name,
          page: 25,
          rows: x.map((v, k) => [v, ...curves.map((s) => s.y[k])]),
          columns: [options.xname, ...series.map((s) => s.name)].map((label, k) => ({
            key: k,
            label,
            type: "number",
          })),
        }),
    });
  };

  /* what an accuracy costs: a curve a solver, a point a tolerance
     options: rows [{solver, tol, mean, solved, of}], style(solver), xlabel, note, name, title */
  Fclib.work = (options) => {
    const names = [...new Set(options.rows.map((r) => r.solver))];
    return Fclib.plot({
      ...options,
      height: (Fclib.isNarrow() ? 330 : 400) + 20 * Math.ceil(names.length / 4),
      says: `${Fclib.count(names.length, "solver")}.`,
      draw: () => ({
        data: names.map((name) => {
          const own = options.rows.filter((r) => r.solver === name);
          const k = options.style(name);
          return {
            type: "scatter",
            mode: "lines+markers",
            name,
            x: own.map((r) => r.mean),
            y: own.map((r) => r.tol),
            text: own.map((r) => `${r.solved} of ${r.of} solved`),
            line: { ...Fclib.stroke(k), width: 2 },
            marker: { symbol: Fclib.SYMBOLS[k % Fclib.SYMBOLS.length], size: 8 },
            hovertemplate: "%{fullData.name}, %{y}: %{x:.3~g} s, %{text}<extra></extra>",
          };
        }),
        layout: {
          hovermode: "closest",
          showlegend: true,
          xaxis: { type: "log", title: { text: options.xlabel } },
          yaxis: { type: "log", title: { text: "tolerance" }, autorange: "reversed" },
        },
      }),
      table: () =>
        Fclib.table({
          caption: options.title,
          name: options.name,
          rows: options.rows,
          page: 40,
          columns: [
            { key: "solver", label: "solver", head: true },
            { key: "tol", label: "tolerance", format: Fclib.tolerance },
            { key: "mean", label: "mean CPU time [s]", type: "number" },
            { key: "solved", label: "solved" },
            { key: "of", label: "of" },
          ],
        }),
    });
  };

  /* options: points [{x, y, problem, group}] null if a solver failed, groups, range, xlabel,
     ylabel, xname, yname, to(problem) */
  Fclib.scatter = (options) => {
    const [low, high] = options.range;
    const end = high * (high / low) ** 0.06;
    const far = high * (high / low) ** 0.1;
    const says = (p) =>
      `${p.problem}<br>${options.xname} ${p.x === null ? "failed" : number(p.x)}<br>` +
      `${options.yname} ${p.y === null ? "failed" : number(p.y)}`;
    const axis = (text) => ({ type: "log", range: [low, far].map(Math.log10), title: { text } });
    const edge = { type: "line", line: { width: 1, color: colour("soft"), dash: "dot" } };
    return Fclib.plot({
      ...options,
      height: (Fclib.isNarrow() ? 380 : 480) + 20 * Math.ceil(options.groups.length / 4),
      says: `${Fclib.count(options.points.length, "problem")}.`,
      href: (point) => options.to(point.customdata),
      draw: () => ({
        data: options.groups.map((group, k) => {
          const own = options.points.filter((p) => p.group === k);
          return {
            type: "scatter",
            mode: "markers",
            name: group,
            x: own.map((p) => p.x ?? end),
            y: own.map((p) => p.y ?? end),
            customdata: own.map((p) => p.problem),
            text: own.map(says),
            hovertemplate: "%{text}<extra></extra>",
            marker: {
              color: colour(`c${k % 7}`),
              symbol: Fclib.SYMBOLS[k % Fclib.SYMBOLS.length],
              size: 8,
              opacity: 0.7,
            },
          };
        }),
        layout: {
          hovermode: "closest",
          showlegend: true,
          xaxis: axis(options.xlabel),
          yaxis: axis(options.ylabel),
          shapes: [
            { ...edge, x0: low, y0: low, x1: high, y1: high },
            { ...edge, x0: high, x1: high, y0: low, y1: far },
            { ...edge, x0: low, x1: far, y0: high, y1: high },
          ],
          annotations: [
            {
              xref: "paper",
              x: 0.01,
              y: Math.log10(end),
              text: "failed ↑",
              showarrow: false,
              xanchor: "left",
            },
            {
              yref: "paper",
              y: 0.01,
              x: Math.log10(end),
              text: "failed →",
              showarrow: false,
              xanchor: "right",
              yanchor: "bottom",
            },
          ],
        },
      }),
      table: () =>
        Fclib.table({
          caption: options.title,
          name: options.name,
          page: 25,
          rows: options.points,
          columns: [
            {
              key: "problem",
              label: "problem",
              head: true,
              cell: (p) => h("a", { href: options.to(p.problem) }, p.problem),
            },
            { key: "x", label: options.xname, type: "number" },
            { key: "y", label: options.yname, type: "number" },
            {
              key: "ratio",
              label: "ratio",
              type: "number",
              value: (p) => (p.x && p.y ? p.x / p.y : null),
            },
            { key: "group", label: "family", type: "text", value: (p) => options.groups[p.group] },
          ],
        }),
    });
  };

  /* whole steps, so that an axis of counts has no half ones */
  const whole = (span) => Math.max(1, Math.ceil(span / 5));
  /* a histogram that Python has counted: name, label, edges, counts, integer */
  Fclib.bars = ({ name, label, edges, counts, integer }) => {
    const middle = counts.map((_, k) => (edges[k] + edges[k + 1]) / 2);
    const span = edges[edges.length - 1] - edges[0];
    const most = Math.max(...counts);
    return Fclib.plot({
      name: `histogram-${name}`,
      title: `Histogram of ${label}`,
      still: true,
      height: 220,
      says: `At most ${Fclib.count(most, "problem")} in a bar.`,
      draw: () => ({
        data: [
          {
            type: "bar",
            x: middle,
            y: counts,
            width: counts.map((_, k) => edges[k + 1] - edges[k]),
            marker: { color: colour("c0"), line: { width: 1, color: colour("back") } },
            hovertemplate: "%{y} at %{x:.3~g}<extra></extra>",
          },
        ],
        layout: {
          margin: { l: 44, r: 8, t: 8, b: 44 },
          xaxis: {
            title: { text: label },
            fixedrange: true,
            nticks: 5,
            // one bar alone does not fill the picture
            range: counts.length > 1 ? undefined : [edges[0] - span, edges[1] + span],
            ...(integer && span < 25 ? { dtick: whole(span), tick0: edges[0] + 0.5 } : {}),
          },
          yaxis: {
            title: { text: "problems" },
            fixedrange: true,
            range: [0, 1.08 * most],
            dtick: whole(most),
            tick0: 0,
          },
        },
      }),
    });
  };

  /* the eigenvalues of W, the largest first */
  Fclib.spectrum = ({ values, size, rank, conditioning }, name) =>
    Fclib.lines({
      name: `spectrum-${name}`,
      title: `Eigenvalues of W of ${name}`,
      series: [{ name: "eigenvalue", x: values.map((_, k) => k + 1), y: values, style: 0 }],
      ends: true,
      ylog: true,
      xrange: [0, Math.max(size, 2)],
      yrange: [values[values.length - 1] / 2, values[0] * 2],
      xname: "number",
      xlabel: "number, the largest first",
      ylabel: "eigenvalue",
      note:
        `Rank ${rank} of ${size}` +
        `${rank < size ? `: ${size - rank} eigenvalues are rounding` : ""}; the largest over ` +
        `the smallest of the others is ${number(conditioning)}.`,
    });

  /* what the file says of itself */
  Fclib.texts = (view) =>
    (view.description || view.math_info) &&
    h(
      "details",
      {},
      h("summary", {}, "What the file says of itself"),
      [view.description, view.math_info]
        .filter(Boolean)
        .map((text) => h("p", { class: "small words" }, text)),
    );

  /* the patterns of matrices: a cell is darker if more of its entries are not zero */
  Fclib.patterns = (list) =>
    h(
      "div",
      {},
      h(
        "div",
        { class: "patterns" },
        list.map((one) => {
          const [m, n] = one.shape;
          const cells = one.shape.map((size) => Math.ceil(size / one.cell));
          const z = [...Array(cells[0])].map(() => Array(cells[1]).fill(null));
          one.rows.forEach((row, k) => {
            z[row][one.columns[k]] = one.counts[k];
          });
          const side = 264 / Math.max(...cells);
          const [tall, wide] = cells.map((count) => Math.max(24, side * count));
          const figure = Fclib.plot({
            name: `pattern-${one.name}`,
            title:
              `Pattern of ${one.name}, ${m} by ${n}, ` +
              `${Fclib.count(one.nnz, "entry", "entries")}`,
            still: true,
            height: tall + 8,
            draw: () => ({
              data: [
                {
                  type: "heatmap",
                  z,
                  zmin: -0.5 * Math.max(...one.counts),
                  colorscale: [
                    [0, colour("back")],
                    [1, colour("accent")],
                  ],
                  showscale: false,
                  hovertemplate:
                    one.cell > 1
                      ? `%{z} entries in cell (%{y}, %{x})<extra></extra>`
                      : "(%{y}, %{x})<extra></extra>",
                },
              ],
              layout: {
                margin: { l: 4, r: 4, t: 4, b: 4 },
                xaxis: { visible: false, range: [-0.5, cells[1] - 0.5], fixedrange: true },
                yaxis: { visible: false, range: [cells[0] - 0.5, -0.5], fixedrange: true },
              },
            }),
            note: [
              h("b", {}, one.name),
              ` ${m} × ${n}, ${Fclib.count(one.nnz, "entry", "entries")} (` +
                `${number((100 * one.nnz) / (m * n), 2)} %)`,
              one.rank && `, rank ${one.rank}`,
              one.conditioning && `, condition number ${number(one.conditioning)}`,
              one.cell > 1 && `; a pixel is ${one.cell} × ${one.cell}`,
            ],
          });
          figure.firstChild.style.width = `${wide + 8}px`;
          return figure;
        }),
      ),
      h(
        "details",
        {},
        h("summary", {}, "As a table"),
        Fclib.table({
          caption: "Matrices",
          rows: list,
          columns: [
            { key: "name", label: "matrix", head: true },
            { key: "m", label: "rows", value: (p) => p.shape[0] },
            { key: "n", label: "columns", value: (p) => p.shape[1] },
            { key: "nnz", label: "entries", type: "number" },
            {
              key: "fill",
              label: "filled",
              type: "number",
              value: (p) => p.nnz / (p.shape[0] * p.shape[1]),
              format: Fclib.percent,
            },
            ...["rank", "conditioning", "determinant"]
              .filter((key) => list.some((p) => p[key]))
              .map((key) => ({ key, label: key, type: "number" })),
          ],
        }),
      ),
    );
})();
