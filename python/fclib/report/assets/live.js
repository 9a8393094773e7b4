// a problem's picture that changes many times a second: bodies, contacts and reactions on a canvas,
// no WebGL. What does not change is drawn by scene.js, which can be searched, saved and measured.
"use strict";
(() => {
  const { h, colour } = Fclib;
  const STATUS = ["open", "stick", "slide"];
  const TINTS = ["t0", "t1", "t2", "t3", "t4"];
  const FACES = 30000; // beyond so many the bodies are left out: their contacts are there
  const NONE = 1e-300; // of a reaction
  const STEP = 0.1; // [rad] of a key

  /* view: as scene.js takes it; figure.show({reactions, forces, status}) draws others; figure.drawn
     counts pictures */
  Fclib.live = (view, name) => {
    const { points, bodies = [], faces = [], images = [], limits = [] } = view.network;
    const { solids } = view;
    const flat = Boolean(solids && solids.planar);
    const hidden = new Set(limits);
    const chosen = points.map((_, k) => k).filter((k) => !hidden.has(k));
    let now = view;
    let largest = NONE;
    // triangles: corners, outward normal, tint
    const facing = ([a, b, c]) => {
      const [p, q] = [b, c].map((x) => x.map((v, i) => v - a[i]));
      const n = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
      const size = Math.hypot(...n) || 1;
      return n.map((x) => x / size);
    };
    const solid = [];
    const ground = [];
    if (solids)
      solids.body.forEach((b, k) => {
        const corners = Fclib.corners(solids, k);
        const tint = TINTS[b % TINTS.length];
        for (const face of solids.meshes[solids.kind[k]][1])
          (solids.moves[b] ? solid : ground).push({ at: face.map((v) => corners[v]), tint });
      });
    else {
      const corners = [...bodies, ...points, ...images];
      for (const face of faces) solid.push({ at: face.map((v) => corners[v]), tint: "body" });
    }
    for (const face of solid) face.normal = facing(face.at);
    const left = solid.length > FACES;
    const every = [
      ...chosen.map((k) => points[k]),
      ...solid.flatMap(({ at }) => at),
      ...(bodies.length && !solids ? bodies : []),
    ];
    if (!every.length) every.push([0, 0, 0]);
    const [low, high] = [Math.min, Math.max].map((most) =>
      [0, 1, 2].map((i) => every.reduce((found, p) => most(found, p[i]), every[0][i])),
    );
    const middle = low.map((x, i) => (x + high[i]) / 2);
    const radius = Math.max(1e-12, Math.hypot(...high.map((x, i) => x - low[i])) / 2);
    const reach = radius / Math.cbrt(Math.max(8, points.length));
    const eye = { turn: flat ? 0 : 0.6, tilt: flat ? 0 : 0.3, zoom: 1 };

    const canvas = h("canvas", {
      tabindex: 0,
      role: "img",
      "aria-label":
        `Bodies, contacts and reactions as they change: ${name}. Arrows turn, plus and minus ` +
        "zoom, 0 resets.",
    });
    const legend = h("ul", { class: "legend" });
    const figure = h(
      "figure",
      { class: "live" },
      canvas,
      h(
        "figcaption",
        {},
        legend,
        view.network.source === "graph"
          ? "A network without positions. The size of a disc is that of the reaction, its " +
              "colour the contact's status."
          : "An arrow is the force on that body of the two which it lifts, in the scale of the " +
              "first picture; its colour is the contact's status.",
        left &&
          ` ${solid.length} faces are too many to be drawn anew at each step: the bodies are ` +
            "left out.",
      ),
    );
    const colours = () =>
      Object.fromEntries(
        [...STATUS, ...TINTS, "body", "line", "text", "normal"].map((key) => [key, colour(key)]),
      );
    let tints = null;
    // the bodies, which stay where they are while reactions change
    const behind = document.createElement("canvas");
    let known = "";
    document.addEventListener("fclib-theme", () => {
      tints = null;
      if (canvas.isConnected) ask();
    });

    const draw = () => {
      const wide = canvas.clientWidth;
      const tall = Math.round(Math.min(0.6 * innerHeight, 480, 1.1 * wide));
      const dense = Math.min(2, devicePixelRatio || 1);
      if (!wide) return;
      canvas.style.height = `${tall}px`;
      if (canvas.width !== Math.round(wide * dense)) canvas.width = Math.round(wide * dense);
      if (canvas.height !== Math.round(tall * dense)) canvas.height = Math.round(tall * dense);
      tints ||= colours();
      const factor = ((0.46 * Math.min(wide, 1.35 * tall)) / radius) * eye.zoom;
      const [c, s, p, t] = [
        Math.cos(eye.turn),
        Math.sin(eye.turn),
        Math.cos(eye.tilt),
        Math.sin(eye.tilt),
      ];
      // to the right, up, towards the eye; without perspective
      const seen = ([x, y, z]) => {
        const [a, b, d] = [x - middle[0], y - middle[1], z - middle[2]];
        const back = c * b - s * a;
        return [
          wide / 2 + factor * (c * a + s * b),
          tall / 2 - factor * (p * d + t * back),
          t * d - p * back,
        ];
      };
      const path = (pen, list) => {
        pen.beginPath();
        list.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
        pen.closePath();
      };
      const drawBodies = () => {
        Object.assign(behind, { width: canvas.width, height: canvas.height });
        const pen = behind.getContext("2d");
        pen.setTransform(dense, 0, 0, dense, 0, 0);
        pen.fillStyle = tints.line;
        pen.globalAlpha = 0.3;
        if (ground.length < FACES)
          for (const { at } of ground) {
            path(pen, at.map(seen));
            pen.fill();
          }
        if (left) return;
        // those that face the eye, from behind to the front
        const light = ({ normal: [x, y, z] }) => p * (s * x - c * y) + t * z;
        const shades = solid
          .map((face) => ({ ...face, light: light(face) }))
          .filter((face) => face.light > 0 || !solids);
        for (const face of shades) {
          face.own = face.at.map(seen);
          face.deep = face.own[0][2] + face.own[1][2] + face.own[2][2];
        }
        for (const { own, tint, light: bright } of shades.sort((a, b) => a.deep - b.deep)) {
          path(pen, own);
          pen.fillStyle = tints[tint];
          pen.globalAlpha = 0.25 + 0.45 * Math.abs(bright);
          pen.fill();
        }
      };
      const wanted = JSON.stringify([eye, canvas.width, canvas.height, tints]);
      if (known !== wanted) {
        drawBodies();
        known = wanted;
      }
      const pen = canvas.getContext("2d");
      pen.setTransform(1, 0, 0, 1, 0, 0);
      pen.clearRect(0, 0, canvas.width, canvas.height);
      pen.drawImage(behind, 0, 0);
      pen.setTransform(dense, 0, 0, dense, 0, 0);
      const dot = Math.min(4.5, Math.max(2, 55 / Math.sqrt(points.length || 1)));
      for (const k of chosen) {
        const status = now.status ? STATUS[Number(now.status[k])] : "normal";
        const [x, y] = seen(points[k]);
        const ink = tints[status];
        const size = now.reactions ? Math.hypot(...now.reactions[k]) : 0;
        pen.fillStyle = pen.strokeStyle = ink;
        if (size > 0 && now.forces) {
          const up = now.forces[k][2] < 0 ? -1 : 1;
          const tip = seen(
            points[k].map((v, i) => v + (up * 1.4 * reach * now.forces[k][i]) / largest),
          );
          const long = Math.hypot(tip[0] - x, tip[1] - y);
          const head = Math.min(7, long);
          if (long > 1) {
            const [ex, ey] = [(tip[0] - x) / long, (tip[1] - y) / long];
            pen.lineWidth = 2;
            pen.beginPath();
            pen.moveTo(x, y);
            pen.lineTo(tip[0] - 0.7 * head * ex, tip[1] - 0.7 * head * ey);
            pen.stroke();
            path(pen, [
              tip,
              [tip[0] - head * ex - 0.4 * head * ey, tip[1] - head * ey + 0.4 * head * ex],
              [tip[0] - head * ex + 0.4 * head * ey, tip[1] - head * ey - 0.4 * head * ex],
            ]);
            pen.fill();
          }
        } else if (size > 0) {
          pen.globalAlpha = 0.4;
          pen.beginPath();
          pen.arc(x, y, 15 * Math.sqrt(size / largest), 0, 7);
          pen.fill();
          pen.globalAlpha = 1;
        }
        pen.beginPath();
        pen.arc(x, y, dot, 0, 7);
        pen.fill();
      }
      figure.drawn = (figure.drawn || 0) + 1;
    };
    let asked = 0;
    const done = [];
    /* draws with the next picture of the screen; the promise says when */
    const ask = () =>
      new Promise((resolve) => {
        done.push(resolve);
        asked ||= requestAnimationFrame(() => {
          asked = 0;
          draw();
          for (const one of done.splice(0)) one();
        });
      });
    figure.show = (found) => {
      now = found;
      if (largest === NONE && now.reactions)
        largest = chosen.reduce((most, k) => Math.max(most, Math.hypot(...now.reactions[k])), NONE);
      if (now.status)
        legend.replaceChildren(
          ...STATUS.map((status, s) =>
            h(
              "li",
              {},
              h("span", { class: "key", style: `background: var(--${status})` }),
              `${status} (${[...now.status].filter((one) => Number(one) === s).length})`,
            ),
          ),
        );
      return ask();
    };
    const turn = (across, up) => {
      if (flat) return;
      eye.turn += across;
      eye.tilt = Math.min(1.55, Math.max(-1.55, eye.tilt + up));
      ask();
    };
    const zoom = (scale) => {
      eye.zoom *= scale;
      ask();
    };
    const keys = {
      ArrowLeft: () => turn(-STEP, 0),
      ArrowRight: () => turn(STEP, 0),
      ArrowUp: () => turn(0, STEP),
      ArrowDown: () => turn(0, -STEP),
      "+": () => zoom(1 / 0.85),
      "=": () => zoom(1 / 0.85),
      "-": () => zoom(0.85),
      0: () => {
        Object.assign(eye, { turn: flat ? 0 : 0.6, tilt: flat ? 0 : 0.3, zoom: 1 });
        ask();
      },
    };
    canvas.addEventListener("keydown", (event) => {
      if (keys[event.key]) {
        event.preventDefault();
        keys[event.key]();
      }
    });
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) turn(-event.movementX / 150, event.movementY / 150);
    });
    new ResizeObserver(() => ask()).observe(canvas);
    figure.show(now);
    return figure;
  };
})();
