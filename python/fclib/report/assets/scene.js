// the network of contacts in space: bodies, contact points, normals and reactions as the traces of one plot
"use strict";
(() => {
  const { h, number, colour } = Fclib;
  const STATUS = ["open", "stick", "slide"];
  const length = (x) => Math.hypot(...x);
  const axes = (points) => Object.fromEntries(["x", "y", "z"].map((name, k) => [name, points.map((p) => p && p[k])]));
  const lines = (pairs) => axes(pairs.flatMap(([a, b]) => [a, b, null]));
  const plus = (a, b, scale) => a.map((x, k) => x + scale * b[k]);
  // balls as meshes: vertices by latitude and longitude
  const [LATITUDES, LONGITUDES] = [8, 12];
  const ball = (centre, radius, vertices, faces) => {
    for (let i = 0; i <= LATITUDES; i++) for (let j = 0; j < LONGITUDES; j++) {
      const [a, b] = [Math.PI * i / LATITUDES, 2 * Math.PI * j / LONGITUDES], first = vertices.length, next = first - j + (j + 1) % LONGITUDES;
      if (i < LATITUDES) faces.push([first, next, first + LONGITUDES], [next, next + LONGITUDES, first + LONGITUDES]);
      vertices.push(plus(centre, [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)], radius));
    }
  };

  Fclib.scene = (view, name) => {
    const { placed, note, bodies, points, pairs, radii, faces, normals, cell, crossing = [], images = [] } = view.network, solved = Boolean(view.reactions);
    // where a contact is at its second body: elsewhere than at its first, across the boundary of a periodic cell
    const image = new Map(crossing.map((k, i) => [k, images[i]])), end = (k, side) => side && image.get(k) || points[k];
    const sizes = solved ? view.reactions.map(length) : [], largest = Math.max(1e-300, ...sizes);
    const reach = (list) => [Math.min, Math.max].map((most) => [0, 1, 2].map((k) => list.reduce((found, p) => most(found, p[k]), list[0][k])));
    const all = [...bodies, ...points, ...images, ...bodies.flatMap((b, k) => radii[k] ? [plus(b, [1, 1, 1], radii[k]), plus(b, [1, 1, 1], -radii[k])] : [])];
    const radius = Math.max(1e-12, length(plus(...reach(all), -1)) / 2), gap = radius / Math.cbrt(bodies.length || points.length);
    const shown = { bodies: true, cell: true, contacts: true, normals: !solved && placed, reactions: solved };
    let scale = 1;
    // a reaction is drawn on the side that it presses down
    const arrows = () => points.map((p, k) => [p, plus(p, view.forces[k], (view.forces[k][2] > 0 ? -1.4 : 1.4) * gap * scale / largest)]).filter((_, k) => sizes[k] > 0);
    const body = (b) => b < 0 ? "the ground" : `body ${b}`;
    const says = points.map((_, k) => `contact ${k}${bodies.length ? `: ${body(pairs[k][0])} and ${body(pairs[k][1])}` : ""}<br>μ = ${number(view.mu[k])}` +
      (solved ? `, ${STATUS[view.status[k]]}<br>r_N = ${number(view.reactions[k][0])}, ‖r_T‖ = ${number(length(view.reactions[k].slice(1)))}` : ""));
    const dot = Math.min(4.5, Math.max(2.2, 60 / Math.sqrt(points.length)));
    const markers = (name, chosen, size, more) => ({ type: "scatter3d", mode: "markers", name, ...axes(chosen.flatMap((k) => image.has(k) ? [points[k], image.get(k)] : [points[k]])), text: chosen.flatMap((k) => image.has(k) ? [says[k], says[k]] : [says[k]]), hovertemplate: "%{text}<extra></extra>", marker: { size, ...more } });

    const traces = {
      bodies: () => {
        const vertices = [...bodies, ...points, ...images], mesh = [...faces];
        bodies.forEach((centre, b) => { if (radii[b]) ball(centre, radii[b], vertices, mesh); });
        const ties = pairs.flatMap((pair, k) => pair.flatMap((b, side) => b >= 0 && !radii[b] ? [[bodies[b], end(k, side)]] : []));
        return [
          { type: "mesh3d", ...axes(vertices), i: mesh.map((f) => f[0]), j: mesh.map((f) => f[1]), k: mesh.map((f) => f[2]), color: colour("body"), opacity: 0.35, hoverinfo: "skip", flatshading: true, lighting: { ambient: 0.7, diffuse: 0.6, specular: 0.1 } },
          { type: "scatter3d", mode: "lines", ...lines(ties), line: { color: colour("body"), width: 1.5 }, opacity: 0.6, hoverinfo: "skip" },
          { type: "scatter3d", mode: "markers", ...axes(bodies), text: bodies.map((_, b) => body(b)), hovertemplate: "%{text}<extra></extra>", marker: { size: 0.7 * dot, color: colour("body") } },
        ];
      },
      cell: () => {
        const corners = (z) => [[0, 0], [1, 0], [1, 1], [0, 1]].map(([i, j]) => [cell[i][0], cell[j][1], z]), [bottom, top] = reach(all).map((p) => corners(p[2]));
        return [{ type: "scatter3d", mode: "lines", ...lines([bottom, top].flatMap((ring) => ring.map((p, k) => [p, ring[(k + 1) % 4]])).concat(bottom.map((p, k) => [p, top[k]]))), line: { color: colour("soft"), width: 2 }, hoverinfo: "skip" }];
      },
      contacts: () => solved ? STATUS.map((status, s) => markers(status, points.flatMap((_, k) => Number(view.status[k]) === s ? [k] : []), dot, { color: colour(status) })) : [markers("contact", points.map((_, k) => k), dot, { color: colour("normal") })],
      normals: () => [{ type: "scatter3d", mode: "lines", ...lines(points.map((p, k) => [p, plus(p, normals[k], 0.35 * gap)])), line: { color: colour("normal"), width: 2 }, hoverinfo: "skip" }],
      reactions: () => {
        // a graph has no directions: the size of a disc is that of the reaction
        if (!view.forces) return [markers("reaction", points.map((_, k) => k), sizes.map((size) => 30 * Math.sqrt(scale * size / largest)), { color: colour("force"), opacity: 0.45, line: { width: 0 } })];
        const drawn = arrows(), tips = drawn.map(([, tip]) => tip), heads = drawn.map(([p, tip]) => plus(tip, p, -1)).map((x) => plus([0, 0, 0], x, Math.max(0.25, Math.min(0.9, 0.15 * gap / length(x))))), [u, v, w] = [0, 1, 2].map((k) => heads.map((x) => x[k]));
        return [
          { type: "scatter3d", mode: "lines", ...lines(drawn), line: { color: colour("force"), width: 3 }, hoverinfo: "skip" },
          { type: "cone", ...axes(tips), u, v, w, anchor: "tip", sizemode: "raw", sizeref: 1, showscale: false, colorscale: [[0, colour("force")], [1, colour("force")]], hoverinfo: "skip" },
        ];
      },
    };

    // ---- the eye
    const corners = cell ? cell.map(([x, y]) => [x, y, points[0][2]]) : [];
    const pad = 0.06 * radius, [low, high] = reach([...all, ...corners, ...view.forces ? arrows().map(([, tip]) => tip) : []]), spans = low.map((x, k) => high[k] - x + 2 * pad), span = Math.max(...spans);
    const ratios = spans.map((x) => Math.max(0.02, x / span)), far = Math.max((Fclib.isNarrow() ? 1.6 : 1.1) * length(ratios), 1.6 * ratios[2]);
    const eye = (turn, tilt, distance) => ({ x: distance * Math.cos(tilt) * Math.sin(turn), y: -distance * Math.cos(tilt) * Math.cos(turn), z: distance * Math.sin(tilt) });
    const start = { eye: eye(0.6, placed ? 0.25 : 0.4, far), center: { x: 0, y: 0, z: -0.08 }, up: { x: 0, y: 0, z: 1 } };
    const look = (box, camera) => Plotly.relayout(box, { "scene.camera": camera });
    const move = (turned, tilted, factor) => (box) => {
      const now = box.layout.scene.camera, { x, y, z } = now.eye, distance = Math.hypot(x, y, z);
      const tilt = Math.min(1.55, Math.max(-1.55, Math.asin(z / distance) + tilted));
      look(box, { ...now, eye: eye(Math.atan2(x, -y) + turned, tilt, distance * factor) });
    };
    const keys = { ArrowLeft: move(-0.1, 0, 1), ArrowRight: move(0.1, 0, 1), ArrowUp: move(0, 0.1, 1), ArrowDown: move(0, -0.1, 1), "+": move(0, 0, 0.85), "=": move(0, 0, 0.85), "-": move(0, 0, 1 / 0.85), 0: (box) => look(box, start) };

    // ---- controls
    const redraw = () => figure.plot.dataset.drawn && figure.plot.draw();
    const groups = Object.keys(traces).filter((key) => ({ bodies: bodies.length > 0, cell: Boolean(cell), contacts: true, normals: Boolean(normals), reactions: solved })[key]);
    const button = (text, key, label) => h("button", { type: "button", "aria-label": label, onclick: () => keys[key](figure.plot) }, text);
    const above = h("div", { class: "controls" },
      groups.map((key) => h("label", { class: "check" }, h("input", { type: "checkbox", checked: shown[key], onchange: (e) => { shown[key] = e.target.checked; redraw(); } }), key)),
      solved && h("label", {}, "scale of reactions", h("input", { type: "range", min: -2, max: 2, step: 0.25, value: 0, onchange: (e) => { scale = 4 ** Number(e.target.value); redraw(); } })),
      button("+", "+", "Zoom in"), button("−", "-", "Zoom out"), button("reset", "0", "Reset the view"));
    const columns = [{ key: "k", label: "contact", head: true },
      ...bodies.length ? [0, 1].map((side) => ({ key: `body${side}`, label: side ? "and body" : "body", value: ({ k }) => pairs[k][side], format: (b) => b < 0 ? "ground" : String(b) })) : [],
      { key: "mu", label: "μ", type: "number", value: ({ k }) => view.mu[k] },
      ...solved ? [{ key: "status", label: "status", value: ({ k }) => STATUS[view.status[k]] }, { key: "rn", label: "r_N", type: "number", value: ({ k }) => view.reactions[k][0] },
        { key: "rt", label: "‖r_T‖", type: "number", value: ({ k }) => length(view.reactions[k].slice(1)) }] : []];
    const figure = Fclib.plot({
      name: `contacts-${name}`, title: `Contact network: ${bodies.length} bodies, ${points.length} contacts`, says: "Arrows turn, plus and minus zoom, 0 resets.", keys, above,
      height: Math.round(Math.min(0.7 * innerHeight, 560)),
      draw: () => ({
        data: groups.filter((key) => shown[key]).flatMap((key) => traces[key]()),
        layout: {
          showlegend: false, margin: { l: 0, r: 0, t: 0, b: 0 },
          scene: {
            camera: start, aspectmode: "manual", aspectratio: Object.fromEntries(["x", "y", "z"].map((key, k) => [key, ratios[k]])),
            ...Object.fromEntries(["x", "y", "z"].map((key, k) => [`${key}axis`, { visible: placed, range: [low[k] - pad, high[k] + pad], title: { text: "" }, nticks: Math.max(2, Math.ceil(8 * ratios[k])), showgrid: key !== "z" }])),
          },
        },
      }),
      table: () => Fclib.table({ caption: "Contacts", name: `contacts-${name}`, columns, rows: points.map((_, k) => ({ k })), page: 25, largest: true }),
      note: [solved && h("ul", { class: "legend" }, STATUS.map((status, s) => h("li", {}, h("span", { class: "key", style: `background: var(--${status})` }), `${status} (${[...view.status].filter((one) => Number(one) === s).length})`))),
        placed ? `To scale, in metres: ${note}.` : `Not to scale, laid out ${note}.`, placed && bodies.length > 0 && " A body is drawn as the hull of its centre and its contacts, or as a ball where these say so.",
        solved && (view.forces ? " An arrow is the reaction on that side of a contact which it presses down." : " The size of a disc is that of the reaction.")],
    });
    figure.classList.add("scene");
    return figure;
  };

  /* all that is drawn of a problem */
  Fclib.pictures = (view, name) => [
    ...view.network ? [h("h2", {}, "Contact network"), Fclib.scene(view, name)] : [h("p", {}, "No contact in this problem.")],
    view.network && !view.reactions && h("p", { class: "soft" }, "The file holds no solution; fclib solve --write stores one."),
    ...view.spectrum && view.spectrum.rank > 1 ? [h("h2", {}, "Spectrum"), Fclib.spectrum(view.spectrum, name)] : [],
    h("h2", {}, "Patterns"), Fclib.patterns(view.patterns), Fclib.texts(view)].filter(Boolean);
})();
