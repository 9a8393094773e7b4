// the pattern of a matrix: one pixel a cell, darker where more of its entries are not zero
"use strict";
(() => {
  const { h, number } = Fclib;
  const one = (pattern) => {
    const [m, n] = pattern.shape, rows = Math.ceil(m / pattern.cell), columns = Math.ceil(n / pattern.cell);
    const zoom = Math.max(1, Math.floor(288 / Math.max(rows, columns)));
    const canvas = h("canvas", { width: columns * zoom, height: rows * zoom, role: "img", "aria-label": `Pattern of ${pattern.name}, ${m} by ${n}, ${pattern.nnz} entries` });
    const draw = () => {
      const context = canvas.getContext("2d");
      context.clearRect(0, 0, canvas.width, canvas.height);
      context.fillStyle = Fclib.colour("accent");
      const most = Math.max(1, ...pattern.counts);
      pattern.rows.forEach((row, k) => {
        context.globalAlpha = 0.35 + 0.65 * pattern.counts[k] / most;
        context.fillRect(pattern.columns[k] * zoom, row * zoom, zoom, zoom);
      });
    };
    draw();
    document.addEventListener("fclib-theme", draw);
    const fill = 100 * pattern.nnz / (m * n);
    return h("figure", {}, canvas, h("figcaption", {}, h("b", {}, pattern.name), ` ${m} × ${n}, ${pattern.nnz} entries (${number(fill, 2)} %)`,
      pattern.rank && `, rank ${pattern.rank}`, pattern.conditioning && `, condition number ${number(pattern.conditioning)}`,
      pattern.cell > 1 && `; a pixel is ${pattern.cell} × ${pattern.cell}`));
  };
  /* the eigenvalues of W, the largest first */
  Fclib.spectrum = ({ values, size, rank, conditioning }, name) => values.length < 2 ? null : Fclib.lines({
    name: `spectrum-${name.replaceAll("/", "-")}`, title: `Eigenvalues of W of ${name}`, series: [{ name: "eigenvalues of W", x: values.map((_, k) => k + 1), y: values, style: 0 }],
    ylog: true, xrange: [0, Math.max(size, 2)], yrange: [values[values.length - 1] / 2, values[0] * 2], xname: "number", xlabel: "number, the largest first", ylabel: "eigenvalue",
    note: `Rank ${rank} of ${size}${rank < size ? `: ${size - rank} eigenvalues are rounding` : ""}; the largest over the smallest of the others is ${number(conditioning)}.`,
  });
  /* what the file says of itself */
  Fclib.texts = (view) => (view.description || view.math_info) && h("details", {}, h("summary", {}, "What the file says of itself"),
    [view.description, view.math_info].filter(Boolean).map((text) => h("p", { class: "small words" }, text)));
  Fclib.patterns = (list) => h("div", {}, h("div", { class: "patterns" }, list.map(one)),
    h("details", {}, h("summary", {}, "As a table"), Fclib.table({
      caption: "Matrices", rows: list,
      columns: [{ key: "name", label: "matrix", head: true }, { key: "m", label: "rows", value: (p) => p.shape[0] }, { key: "n", label: "columns", value: (p) => p.shape[1] },
        { key: "nnz", label: "entries", type: "number" }, { key: "fill", label: "filled", type: "number", value: (p) => p.nnz / (p.shape[0] * p.shape[1]), format: Fclib.percent },
        ...["rank", "conditioning", "determinant"].filter((key) => list.some((p) => p[key])).map((key) => ({ key, label: key, type: "number" }))],
    })));
})();
