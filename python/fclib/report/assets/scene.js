// a problem's picture: bodies, contact points, normals and reactions; in space by WebGL, of a plane
// as a drawing
"use strict";
(() => {
  const { h, number, colour } = Fclib;
  const STATUS = ["open", "stick", "slide"];
  const TINTS = ["t0", "t1", "t2", "t3", "t4"];
  const VIEW = Math.PI / 4; // [rad] what Plotly's eye sees, from bottom to top
  const ROUNDS = 3; // of aiming the eye: then the middle moves by no pixel
  const FILLED = 0.9; // of a picture is the scene; the rest has the numbers of the axes
  const length = (x) => Math.hypot(...x);
  const axes = (points) =>
    Object.fromEntries(["x", "y", "z"].map((name, k) => [name, points.map((p) => p && p[k])]));
  const lines = (pairs) => axes(pairs.flatMap(([a, b]) => [a, b, null]));
  const plus = (a, b, scale) => a.map((x, k) => x + scale * b[k]);
  const reach = (list) =>
    [Math.min, Math.max].map((most) =>
      [0, 1, 2].map((k) => list.reduce((found, p) => most(found, p[k]), list[0][k])),
    );

  // ---- solids: a kind's mesh of size one, scaled, turned and put in its place; solids.py has the
  // same
  const turned = ([w, x, y, z], [a, b, c]) => {
    // v + 2 q x (q x v + w v)
    const p = y * c - z * b + w * a;
    const q = z * a - x * c + w * b;
    const r = x * b - y * a + w * c;
    return [a + 2 * (y * r - z * q), b + 2 * (z * p - x * r), c + 2 * (x * q - y * p)];
  };
  /* the corners of a shape in the world; poses: {place, turn} of another step */
  Fclib.corners = (solids, shape, poses = solids) => {
    const [sx, sy, sz, s] = solids.scale[shape];
    const place = poses.place[shape];
    const turn = poses.turn[shape];
    return solids.meshes[solids.kind[shape]][0].map(([x, y, z, t]) =>
      plus(place, turned(turn, [x * sx, y * sy, z * sz + t * s]), 1),
    );
  };
  /* the outline of points in the plane x, z, about it once */
  Fclib.outline = (points) => {
    const sorted = points.map((p) => [p[0], p[2]]).sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const half = (list) =>
      list.reduce((found, p) => {
        while (found.length > 1) {
          const [a, b] = found.slice(-2);
          if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
          found.pop();
        }
        return [...found, p];
      }, []);
    return [...half(sorted).slice(0, -1), ...half(sorted.reverse())];
  };
  const tint = (body) => colour(TINTS[body % TINTS.length]);

  Fclib.scene = (view, name, sequence) => {
    const {
      source,
      note,
      bodies,
      points,
      pairs,
      faces = [],
      normals,
      crossing = [],
      images = [],
      limits = [],
    } = view.network;
    const { solids } = view;
    const flat = solids && solids.planar;
    const placed = source !== "graph";
    const solved = Boolean(view.reactions);
    const unit = solids ? solids.unit : "m";
    const limited = new Set(limits);
    const drawn = points.map((_, k) => k).filter((k) => !limited.has(k));
    // where a contact is at its second body: elsewhere than at its first, across the boundary of a
    // periodic cell
    const image = new Map(crossing.map((k, i) => [k, images[i]]));
    const end = (k, side) => (side && image.get(k)) || points[k];
    const sizes = solved ? view.reactions.map(length) : [];
    const largest = Math.max(1e-300, ...drawn.map((k) => sizes[k] || 0));
    const shapes = solids ? solids.body.map((_, k) => k) : [];
    const moving = shapes.filter((k) => solids.moves[solids.body[k]]);
    const fixed = shapes.filter((k) => !solids.moves[solids.body[k]]);
    const own = new Map(shapes.map((k) => [k, Fclib.corners(solids, k)]));
    let poses = null; // of another step of the sequence
    const corners = (k) =>
      poses && poses.at[k] !== undefined
        ? Fclib.corners(solids, k, {
            place: { [k]: poses.place[poses.at[k]] },
            turn: { [k]: poses.turn[poses.at[k]] },
          })
        : own.get(k);
    const here = drawn.map((k) => points[k]);
    const all = [
      ...here,
      ...(solids
        ? (moving.length ? moving : shapes).flatMap((k) => own.get(k))
        : [...bodies, ...images]),
    ];
    if (!all.length) all.push([0, 0, 0], [1, 1, 1]);
    const [low, high] = reach(all);
    const radius = Math.max(1e-12, length(plus(high, low, -1)) / 2);
    // of the cell: about the origin if the file says it, else where the recovered bodies are
    const cell =
      solids && solids.period
        ? [solids.period.map((p) => -p / 2), solids.period.map((p) => p / 2)]
        : view.network.cell;
    const gap = radius / Math.cbrt(Math.max(8, moving.length || bodies.length, points.length));
    const shown = {
      bodies: true,
      fixed: true,
      cell: true,
      contacts: true,
      normals: !solved && placed,
      reactions: solved,
    };
    let scale = 1;
    let glass = false;
    const names = solids ? solids.names : [];
    const body = (b) => (b < 0 ? "the ground" : names[b] || `body ${b}`);
    const known = pairs.length > 0 && (bodies.length > 0 || names.length > 0);
    const says = points.map(
      (_, k) =>
        `contact ${k}` +
        (known ? `: ${body(pairs[k][0])} and ${body(pairs[k][1])}` : "") +
        `<br>μ = ${number(view.mu[k])}` +
        (solved
          ? `, ${STATUS[view.status[k]]}<br>r_N = ${number(view.reactions[k][0])}, ‖r_T‖ = ` +
            `${number(length(view.reactions[k].slice(1)))}`
          : ""),
    );
    const dot =
      (Fclib.isNarrow() ? 0.6 : 1) * Math.min(4.5, Math.max(2.2, 60 / Math.sqrt(points.length)));
    // the force on that body which it carries: upwards, here as in all pictures
    const arrows = (chosen) =>
      chosen
        .filter((k) => sizes[k] > 0)
        .map((k) => {
          const up = view.forces[k][2] < 0 ? -1 : 1;
          return [points[k], plus(points[k], view.forces[k], (up * 1.4 * gap * scale) / largest)];
        });
    const byStatus = (make) =>
      STATUS.flatMap((status, s) =>
        make(
          status,
          drawn.filter((k) => Number(view.status[k]) === s),
        ),
      );
    const twice = (chosen) =>
      chosen.flatMap((k) =>
        image.has(k)
          ? [
              [k, points[k]],
              [k, image.get(k)],
            ]
          : [[k, points[k]]],
      );

    // ---- in space
    const markers = (label, chosen, size, more) => {
      const at = twice(chosen);
      return {
        type: "scatter3d",
        mode: "markers",
        name: label,
        ...axes(at.map(([, p]) => p)),
        text: at.map(([k]) => says[k]),
        hovertemplate: "%{text}<extra></extra>",
        marker: { size, ...more },
      };
    };
    const mesh = (chosen, more, painted) => {
      const vertices = [];
      const triangles = [];
      const facecolor = [];
      const intensity = [];
      for (const k of chosen) {
        const first = vertices.length;
        const [, list] = solids.meshes[solids.kind[k]];
        const strain = solids.strain && solids.strain[solids.kind[k]];
        vertices.push(...corners(k));
        if (strain) intensity.push(...strain);
        for (const f of list) {
          triangles.push(f.map((v) => v + first));
          if (painted) facecolor.push(tint(solids.body[k]));
        }
      }
      return {
        type: "mesh3d",
        ...axes(vertices),
        i: triangles.map((f) => f[0]),
        j: triangles.map((f) => f[1]),
        k: triangles.map((f) => f[2]),
        hoverinfo: "skip",
        flatshading: true,
        lighting: { ambient: 0.65, diffuse: 0.7, specular: 0.05 },
        ...(intensity.length && !poses
          ? {
              intensity,
              colorscale: "Viridis",
              colorbar: {
                title: { text: `displacement [${unit}]`, side: Fclib.isNarrow() ? "top" : "right" },
                thickness: 12,
                len: 0.6,
                ...(Fclib.isNarrow() ? { orientation: "h", y: 0, yanchor: "bottom" } : {}),
              },
            }
          : painted
            ? { facecolor }
            : {}),
        ...more,
      };
    };
    const strained = moving.filter((k) => solids.strain && solids.strain[solids.kind[k]]);
    const rigid = moving.filter((k) => !strained.includes(k));
    const hulls = () => {
      const vertices = [...bodies, ...points, ...images];
      const ties = pairs.flatMap((pair, k) =>
        pair.flatMap((b, side) => (b >= 0 ? [[bodies[b], end(k, side)]] : [])),
      );
      return [
        {
          type: "mesh3d",
          ...axes(vertices),
          i: faces.map((f) => f[0]),
          j: faces.map((f) => f[1]),
          k: faces.map((f) => f[2]),
          color: colour("body"),
          opacity: 0.35,
          hoverinfo: "skip",
          flatshading: true,
          lighting: { ambient: 0.7, diffuse: 0.6, specular: 0.1 },
        },
        {
          type: "scatter3d",
          mode: "lines",
          ...lines(ties),
          line: { color: colour("body"), width: 1.5 },
          opacity: 0.6,
          hoverinfo: "skip",
        },
        {
          type: "scatter3d",
          mode: "markers",
          ...axes(bodies),
          text: bodies.map((_, b) => body(b)),
          hovertemplate: "%{text}<extra></extra>",
          marker: { size: 0.7 * dot, color: colour("body") },
        },
      ];
    };
    const spatial = {
      bodies: () =>
        !solids
          ? hulls()
          : [
              rigid.length && mesh(rigid, { opacity: glass && !poses ? 0.55 : 1 }, true),
              strained.length && mesh(strained, { opacity: glass && !poses ? 0.75 : 1 }),
            ].filter(Boolean),
      fixed: () => (fixed.length ? [mesh(fixed, { color: colour("open"), opacity: 0.14 })] : []),
      cell: () => {
        const ring = (z) =>
          [
            [0, 0],
            [1, 0],
            [1, 1],
            [0, 1],
          ].map(([i, j]) => [cell[i][0], cell[j][1], z]);
        const [bottom, top] = [ring(low[2]), ring(high[2])];
        return [
          {
            type: "scatter3d",
            mode: "lines",
            ...lines(
              [bottom, top]
                .flatMap((list) => list.map((p, k) => [p, list[(k + 1) % 4]]))
                .concat(bottom.map((p, k) => [p, top[k]])),
            ),
            line: { color: colour("soft"), width: 2 },
            hoverinfo: "skip",
          },
        ];
      },
      contacts: () =>
        solved
          ? byStatus((status, chosen) => [markers(status, chosen, dot, { color: colour(status) })])
          : [markers("contact", drawn, dot, { color: colour("normal") })],
      normals: () => [
        {
          type: "scatter3d",
          mode: "lines",
          ...lines(drawn.map((k) => [points[k], plus(points[k], normals[k], 0.35 * gap)])),
          line: { color: colour("normal"), width: 2 },
          hoverinfo: "skip",
        },
      ],
      reactions: () => {
        // a graph has no directions: the size of a disc is that of the reaction
        if (!view.forces)
          return byStatus((status, chosen) => [
            markers(
              `${status} reaction`,
              chosen,
              chosen.map((k) => 30 * Math.sqrt((scale * sizes[k]) / largest)),
              { color: colour(status), opacity: 0.45, line: { width: 0 } },
            ),
          ]);
        return byStatus((status, chosen) => {
          const list = arrows(chosen);
          const heads = list
            .map(([p, tip]) => plus(tip, p, -1))
            .map((x) =>
              plus([0, 0, 0], x, Math.max(0.25, Math.min(0.9, (0.15 * gap) / length(x)))),
            );
          const [u, v, w] = [0, 1, 2].map((k) => heads.map((x) => x[k]));
          return list.length
            ? [
                {
                  type: "scatter3d",
                  mode: "lines",
                  ...lines(list),
                  line: { color: colour(status), width: 4 },
                  hoverinfo: "skip",
                },
                {
                  type: "cone",
                  ...axes(list.map(([, tip]) => tip)),
                  u,
                  v,
                  w,
                  anchor: "tip",
                  sizemode: "raw",
                  sizeref: 1,
                  showscale: false,
                  colorscale: [
                    [0, colour(status)],
                    [1, colour(status)],
                  ],
                  hoverinfo: "skip",
                },
              ]
            : [];
        });
      },
    };

    // ---- in the plane x, z
    const plane = (list) => ({ x: list.map((p) => p && p[0]), y: list.map((p) => p && p[2]) });
    const filled = (chosen, more) =>
      Object.entries(
        Object.groupBy
          ? Object.groupBy(chosen, (k) => solids.body[k] % TINTS.length)
          : { 0: chosen },
      ).map(([group, those]) => {
        const rings = those.flatMap((k) => [
          ...Fclib.outline(corners(k)).map(([x, z]) => [x, 0, z]),
          null,
        ]);
        return {
          type: "scatter",
          mode: "lines",
          ...plane(rings),
          fill: "toself",
          fillcolor: tint(Number(group)),
          line: { color: colour("text"), width: 0.7 },
          hoverinfo: "skip",
          ...more,
        };
      });
    const dots = (label, chosen, more) => ({
      type: "scatter",
      mode: "markers",
      name: label,
      ...plane(chosen.map((k) => points[k])),
      text: chosen.map((k) => says[k]),
      hovertemplate: "%{text}<extra></extra>",
      marker: { size: 1.6 * dot, ...more },
    });
    const planar = {
      bodies: () => filled(moving, { opacity: 0.85 }),
      fixed: () =>
        filled(fixed, { fillcolor: colour("line"), line: { color: colour("open"), width: 1 } }),
      contacts: () =>
        solved
          ? byStatus((status, chosen) => [dots(status, chosen, { color: colour(status) })])
          : [dots("contact", drawn, { color: colour("normal") })],
      normals: () => [
        {
          type: "scatter",
          mode: "lines",
          ...plane(
            drawn.flatMap((k) => [points[k], plus(points[k], normals[k], 0.35 * gap), null]),
          ),
          line: { color: colour("normal"), width: 1.5 },
          hoverinfo: "skip",
        },
      ],
      reactions: () =>
        byStatus((status, chosen) => {
          const list = arrows(chosen);
          return list.length
            ? [
                {
                  type: "scatter",
                  mode: "lines",
                  ...plane(list.flatMap(([p, tip]) => [p, tip, null])),
                  line: { color: colour(status), width: 2 },
                  hoverinfo: "skip",
                },
                {
                  type: "scatter",
                  mode: "markers",
                  ...plane(list.map(([, tip]) => tip)),
                  marker: {
                    symbol: "triangle-up",
                    size: 8,
                    color: colour(status),
                    angle: list.map(
                      ([p, tip]) => (Math.atan2(tip[0] - p[0], tip[2] - p[2]) * 180) / Math.PI,
                    ),
                  },
                  hoverinfo: "skip",
                },
              ]
            : [];
        }),
    };
    const traces = flat ? planar : spatial;

    // ---- the eye
    const frame = cell ? cell.map(([x, y]) => [x, y, low[2]]) : [];
    const bounds = [...all, ...frame, ...(view.forces ? arrows(drawn).map(([, tip]) => tip) : [])];
    const pad = 0.06 * radius;
    // another step of the sequence may reach further
    const window3d = () => {
      const [from, to] = reach(poses ? [...bounds, ...poses.reach] : bounds);
      const spans = from.map((x, k) => to[k] - x + 2 * pad);
      const span = Math.max(...spans);
      return { from, to, ratios: spans.map((x) => Math.max(0.02, x / span)) };
    };
    const { from, to, ratios } = window3d();
    const eye = (turn, tilt, distance) => ({
      x: distance * Math.cos(tilt) * Math.sin(turn),
      y: -distance * Math.cos(tilt) * Math.cos(turn),
      z: distance * Math.sin(tilt),
    });
    // a long thin scene is shown from near its middle, or no body could be seen; picture.py has the
    // same bound
    const thin = placed && moving.length > 2 && [...ratios].sort((a, b) => b - a)[1] < 0.15;
    const [TURN, TILT] = [0.6, placed ? 0.3 : 0.4];
    // to the right, up and towards the eye, as it is at first
    const AXES = [
      [Math.cos(TURN), Math.sin(TURN), 0],
      [-Math.sin(TILT) * Math.sin(TURN), Math.sin(TILT) * Math.cos(TURN), Math.cos(TILT)],
      Object.values(eye(TURN, TILT, 1)),
    ];
    /* where the eye looks, and from how far, so that a picture of these proportions (wide over
       tall) is filled */
    const aimed = (proportions) => {
      const span = Math.max(...from.map((x, k) => to[k] - x + 2 * pad));
      const seen = bounds.map((p) => {
        const place = p.map((value, k) => (value - (from[k] + to[k]) / 2) / span);
        return AXES.map((axis) => axis.reduce((sum, x, k) => sum + x * place[k], 0));
      });
      const reached = FILLED * Math.tan(VIEW / 2);
      const needed = ([across, up, near], aim) =>
        near + Math.max(Math.abs(across - aim[0]) / proportions, Math.abs(up - aim[1])) / reached;
      const least = (aim) => seen.reduce((most, p) => Math.max(most, needed(p, aim)), 0);
      let aim = [0, 0];
      // what is near is larger: the middle of what is seen is not that of the scene
      for (let round = 0; round < ROUNDS; round++) {
        const far = least(aim);
        const places = seen.map((p) => aim.map((x, k) => (p[k] - x) / (far - p[2])));
        aim = aim.map((x, k) => {
          const list = places.map((place) => place[k]);
          const [a, b] = [Math.min, Math.max].map((most) => list.reduce((m, v) => most(m, v)));
          return x + (far * (a + b)) / 2;
        });
      }
      return {
        far: least(aim),
        centre: [0, 1, 2].map((k) => aim[0] * AXES[0][k] + aim[1] * AXES[1][k]),
      };
    };
    const camera = (turn, tilt, far, [x, y, z]) => {
      const away = eye(turn, tilt, far);
      return {
        eye: { x: away.x + x, y: away.y + y, z: away.z + z },
        center: { x, y, z },
        up: { x: 0, y: 0, z: 1 },
      };
    };
    const start = (box) => {
      const { far, centre } = aimed(box.clientWidth / box.clientHeight);
      return thin ? camera(TURN, TILT, 0.25 * far, [0, 0, 0]) : camera(TURN, TILT, far, centre);
    };
    const look = (box, seen) => Plotly.relayout(box, { "scene.camera": seen });
    const move = (turn, tilted, factor) => (box) => {
      // Plotly's own buttons leave parts of it out
      const now = { ...start(box), ...box.layout.scene.camera };
      const centre = Object.values(now.center);
      const [x, y, z] = Object.values(now.eye).map((value, k) => value - centre[k]);
      const far = Math.hypot(x, y, z);
      const tilt = Math.min(1.55, Math.max(-1.55, Math.asin(z / far) + tilted));
      look(box, camera(Math.atan2(x, -y) + turn, tilt, far * factor, centre));
    };
    const window2d = { xaxis: [from[0] - pad, to[0] + pad], yaxis: [from[2] - pad, to[2] + pad] };
    const zoom = (factor) => (box) =>
      Plotly.relayout(
        box,
        Object.fromEntries(
          ["xaxis", "yaxis"].map((key) => {
            const [a, b] = box.layout[key].range;
            const middle = (a + b) / 2;
            return [
              `${key}.range`,
              [middle + (a - middle) * factor, middle + (b - middle) * factor],
            ];
          }),
        ),
      );
    const moves = flat
      ? {
          "+": zoom(0.85),
          "=": zoom(0.85),
          "-": zoom(1 / 0.85),
          0: (box) =>
            Plotly.relayout(box, { "xaxis.range": window2d.xaxis, "yaxis.range": window2d.yaxis }),
        }
      : {
          ArrowLeft: move(-0.1, 0, 1),
          ArrowRight: move(0.1, 0, 1),
          ArrowUp: move(0, 0.1, 1),
          ArrowDown: move(0, -0.1, 1),
          "+": move(0, 0, 0.85),
          "=": move(0, 0, 0.85),
          "-": move(0, 0, 1 / 0.85),
          0: (box) => look(box, start(box)),
        };
    // a button may be pressed before the picture is drawn
    const keys = Object.fromEntries(
      Object.entries(moves).map(([key, act]) => [
        key,
        (box) => (box.matches(".js-plotly-plot") ? act(box) : undefined),
      ]),
    );

    // ---- controls
    const redraw = () => figure.plot.dataset.drawn && figure.plot.draw();
    const there = {
      bodies: bodies.length > 0 || moving.length > 0,
      fixed: fixed.length > 0,
      cell: Boolean(cell) && !flat,
      contacts: drawn.length > 0,
      normals: Boolean(normals),
      reactions: solved && drawn.length > 0,
    };
    // of another step the bodies alone are known
    const groups = Object.keys(traces).filter((key) => there[key]);
    const present = () =>
      groups.filter((key) => shown[key] && (!poses || ["bodies", "fixed", "cell"].includes(key)));
    const check = (text, checked, act) =>
      h(
        "label",
        { class: "check" },
        h("input", {
          type: "checkbox",
          checked,
          onchange: (e) => {
            act(e.target.checked);
            redraw();
          },
        }),
        text,
      );
    const button = (text, key, label) =>
      h(
        "button",
        { type: "button", "aria-label": label, onclick: () => keys[key](figure.plot) },
        text,
      );
    const controls = h(
      "div",
      { class: "controls" },
      groups.map((key) =>
        check(key, shown[key], (on) => {
          shown[key] = on;
        }),
      ),
      solids &&
        !flat &&
        moving.length > 0 &&
        check("see-through", glass, (on) => {
          glass = on;
        }),
      solved &&
        h(
          "label",
          {},
          "scale of reactions",
          h("input", {
            type: "range",
            min: -2,
            max: 2,
            step: 0.25,
            value: 0,
            onchange: (e) => {
              scale = 4 ** Number(e.target.value);
              redraw();
            },
          }),
        ),
      button("+", "+", "Zoom in"),
      button("−", "-", "Zoom out"),
      button("reset", "0", "Reset the view"),
    );
    const steps = sequence && solids && h("div", { class: "controls steps" });
    if (steps)
      player(steps, sequence, (found) => {
        poses = found;
        redraw();
      });
    const columns = [
      { key: "k", label: "contact", head: true },
      ...(bodies.length || names.length
        ? [0, 1].map((side) => ({
            key: `body${side}`,
            label: side ? "and body" : "body",
            value: ({ k }) => body(pairs[k][side]),
          }))
        : []),
      { key: "mu", label: "μ", type: "number", value: ({ k }) => view.mu[k] },
      ...(solved
        ? [
            { key: "status", label: "status", value: ({ k }) => STATUS[view.status[k]] },
            { key: "rn", label: "r_N", type: "number", value: ({ k }) => view.reactions[k][0] },
            {
              key: "rt",
              label: "‖r_T‖",
              type: "number",
              value: ({ k }) => length(view.reactions[k].slice(1)),
            },
          ]
        : []),
      ...(placed
        ? ["x", "y", "z"].map((key, i) => ({
            key,
            label: `${key} [${unit}]`,
            type: "number",
            value: ({ k }) => (limited.has(k) ? null : points[k][i]),
          }))
        : []),
    ];
    const count = solids ? new Set(moving.map((k) => solids.body[k])).size : bodies.length;
    const figure = Fclib.plot({
      name: `contacts-${name}`,
      title:
        `${placed ? "Bodies and contacts" : "Contact network"}: ` +
        `${Fclib.count(count, "body", "bodies")}, ` +
        `${Fclib.count(points.length, "contact")}`,
      says: flat ? "Plus and minus zoom, 0 resets." : "Arrows turn, plus and minus zoom, 0 resets.",
      keys,
      below: [controls, steps].filter(Boolean),
      height: Math.round(
        Math.min(0.7 * innerHeight, 560, Fclib.isNarrow() ? 0.85 * innerWidth : Infinity),
      ),
      space: !flat,
      picture: true,
      draw: () => {
        const shot = window3d();
        return {
          data: present().flatMap((key) => traces[key]()),
          layout: flat
            ? {
                showlegend: false,
                margin: { l: 50, r: 10, t: 10, b: 40 },
                hovermode: "closest",
                dragmode: "pan",
                xaxis: {
                  range: [shot.from[0] - pad, shot.to[0] + pad],
                  title: { text: `x [${unit}]` },
                  scaleanchor: "y",
                },
                yaxis: {
                  range: [shot.from[2] - pad, shot.to[2] + pad],
                  title: { text: `z [${unit}]` },
                },
              }
            : {
                showlegend: false,
                margin: { l: 0, r: 0, t: 0, b: 0 },
                scene: {
                  camera: start(figure.plot),
                  aspectmode: "manual",
                  aspectratio: Object.fromEntries(
                    ["x", "y", "z"].map((key, k) => [key, shot.ratios[k]]),
                  ),
                  ...Object.fromEntries(
                    ["x", "y", "z"].map((key, k) => [
                      `${key}axis`,
                      {
                        visible: placed,
                        range: [shot.from[k] - pad, shot.to[k] + pad],
                        title: { text: "" },
                        nticks: Math.max(2, Math.ceil(8 * shot.ratios[k])),
                        showgrid: key !== "z",
                      },
                    ]),
                  ),
                },
              },
        };
      },
      table: () =>
        Fclib.table({
          caption: "Contacts",
          name: `contacts-${name}`,
          columns,
          rows: points.map((_, k) => ({ k })),
          page: 25,
          largest: true,
        }),
      note: [
        solved &&
          h(
            "ul",
            { class: "legend" },
            STATUS.map((status, s) =>
              h(
                "li",
                {},
                h("span", { class: "key", style: `background: var(--${status})` }),
                `${status} (${[...view.status].filter((one) => Number(one) === s).length})`,
              ),
            ),
          ),
        source === "file"
          ? `To scale, in ${unit}: shapes and positions as the file has them` +
            `${solids.strain ? "; colour is the displacement since there was no stress" : ""}` +
            `${flat ? "; a plane" : ""}.`
          : placed
            ? `To scale, in metres: ${note}. A body is drawn as the hull of its centre and its ` +
              "contacts: its shape is not known."
            : `A network without positions, laid out ${note}.`,
        thin && !flat && " The scene is long and thin: this is its middle, and − shows more of it.",
        limits.length > 0 &&
          ` Of the contacts ${Fclib.count(limits.length, "is a limit", "are limits")} of ` +
            "joints or dry friction in them, without a place.",
        solved &&
          (view.forces
            ? " An arrow is the force on that body of the two which it lifts; its colour is " +
              "the contact's status."
            : " The size of a disc is that of the reaction."),
      ],
    });
    figure.classList.add("scene");
    return figure;
  };

  /* the steps of a simulation, to go through by hand or to play
     sequence: {load() -> {numbers, at, place, turn}, number, href(number)} */
  const player = (box, sequence, show) => {
    let timer = 0;
    let data = null;
    let frame = 0;
    const position = h("span", { class: "small" });
    const slider = h("input", {
      type: "range",
      min: 0,
      max: 1,
      step: 1,
      value: 0,
      "aria-label": "Step of the sequence",
    });
    const put = (k) => {
      frame = k;
      slider.value = k;
      const problem = data.numbers[k];
      show(
        problem === sequence.number
          ? null
          : { at: data.at, place: data.place[k], turn: data.turn[k], reach: data.reach },
      );
      position.replaceChildren(
        problem === sequence.number
          ? `problem ${problem}, this one, ${k + 1} of ${data.numbers.length}`
          : h(
              "span",
              {},
              h("a", { href: sequence.href(problem) }, `problem ${problem}`),
              `, ${k + 1} of ${data.numbers.length}: its bodies`,
            ),
      );
    };
    const ready = async () => {
      if (data) return;
      data = await sequence.load();
      slider.max = data.numbers.length - 1;
      frame = Math.max(
        0,
        data.numbers.findIndex((n) => n >= sequence.number),
      );
    };
    const stop = () => {
      clearInterval(timer);
      timer = 0;
      play.textContent = "▶ play";
    };
    const play = h(
      "button",
      {
        type: "button",
        onclick: async () => {
          if (timer) {
            stop();
            return;
          }
          await ready();
          play.textContent = "❚❚ pause";
          if (frame >= data.numbers.length - 1) frame = -1;
          timer = setInterval(() => {
            if (!box.isConnected || frame >= data.numbers.length - 1) stop();
            else put(frame + 1);
          }, 120);
        },
      },
      "▶ play",
    );
    slider.addEventListener("input", async () => {
      const wanted = Number(slider.value);
      stop();
      await ready();
      put(wanted);
    });
    slider.addEventListener("focus", async () => {
      await ready();
      slider.value = frame;
    });
    box.append(h("span", { class: "small soft" }, "the sequence"), play, slider, position);
    slider.max = sequence.count - 1;
    slider.value = Math.max(0, sequence.numbers.indexOf(sequence.number));
  };

  /* what a page shows first: the picture beside the facts, below each other if there is no room */
  Fclib.stage = (picture, known) =>
    h("div", { class: "stage" }, picture, Fclib.facts(known, "facts chief"));

  /* what else is drawn of a problem */
  Fclib.drawings = (view, name) =>
    [
      view.spectrum &&
        view.spectrum.rank > 1 &&
        Fclib.folded("Spectrum of W", Fclib.spectrum(view.spectrum, name)),
      Fclib.folded("Patterns of the matrices", Fclib.patterns(view.patterns)),
      Fclib.texts(view),
    ].filter(Boolean);
})();
