// The figures of docs/contact-problem.md, alive: sliders change a small problem, the core solves it
// in the page (docs/browser.md), and it is drawn. A page of a folder of files keeps its pictures.
"use strict";
(() => {
  const MODULE = "_static/browser/fclib.js";
  const BUILT = false; // build.py says true where the site has the module
  const GRAVITY = 9.81; // [m/s^2]
  const STEP = 0.01; // [s]
  const DENSITY = 1000; // [kg/m^2] of bodies in the plane
  const TOLERANCE = 1e-10;
  const LIMIT = 2; // [s] of a solve
  const COLOURS = {
    open: "#7d8b98",
    stick: "#1f8a52",
    slide: "#d9661f",
    body: "#5b8fc9",
    fixed: "#8895a2",
    r: "#c0392b",
    u: "#2a7fc4",
    hat: "#1f8a52",
    cone: "#d99652",
    dual: "#7a6fb0",
  };

  // ---- elements
  const set = (element, attributes) => {
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    return element;
  };
  const make = (tag, attributes, ...children) => {
    const made = set(document.createElement(tag), attributes);
    made.append(...children);
    return made;
  };
  const svg = (tag, attributes, text = "") => {
    const made = set(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes);
    made.textContent = text;
    return made;
  };
  const shown = (x, digits = 3) => {
    const short = Number(x.toPrecision(digits));
    return String(Math.abs(short) < 1e-9 ? 0 : short).replace("-", "−");
  };
  const plus = (a, b, scale = 1) => a.map((x, k) => x + scale * b[k]);
  const norm = (a) => Math.hypot(...a);

  const slider = ({ label, unit = "", min, max, step, value }, act) => {
    const input = make("input", { type: "range", min, max, step, "aria-label": label });
    input.value = value;
    const said = make("span", {});
    const tell = () => {
      said.textContent = `${label} = ${shown(Number(input.value))}${unit && ` ${unit}`}`;
    };
    input.addEventListener("input", () => {
      tell();
      act();
    });
    tell();
    return {
      element: make("label", {}, said, input),
      get value() {
        return Number(input.value);
      },
      get said() {
        return said.textContent;
      },
    };
  };

  const DARTS = 9; // [px] of the head of an arrow
  const arrow = (box, [x, y], [dx, dy], colour, width = 2.5, dashed = false) => {
    const size = Math.hypot(dx, dy);
    if (size < 1) return;
    const [tx, ty] = [x + dx, y + dy];
    const [ex, ey] = [dx / size, dy / size];
    const head = Math.min(DARTS, size);
    box.append(
      svg("line", {
        x1: x,
        y1: y,
        x2: tx - 0.7 * head * ex,
        y2: ty - 0.7 * head * ey,
        stroke: colour,
        "stroke-width": width,
        "stroke-dasharray": dashed ? "4 3" : "none",
      }),
    );
    const wing = (side) =>
      `${tx - head * ex - side * 0.4 * head * ey},${ty - head * ey + side * 0.4 * head * ex}`;
    box.append(svg("polygon", { points: `${tx},${ty} ${wing(1)} ${wing(-1)}`, fill: colour }));
  };

  // ---- bodies in the plane x, z, as a global problem
  const bodyOf = (corners) => {
    let area = 0;
    let middle = [0, 0];
    let about = 0;
    corners.forEach(([x, z], k) => {
      const [a, b] = corners[(k + 1) % corners.length];
      const cross = x * b - a * z;
      area += cross / 2;
      middle = plus(middle, [x + a, z + b], cross / 6);
      about += (cross * (x * x + x * a + a * a + z * z + z * b + b * b)) / 12;
    });
    const sign = Math.sign(area);
    const centre = middle.map((x) => x / area);
    const mass = DENSITY * sign * area;
    return {
      corners,
      centre,
      mass,
      inertia: DENSITY * sign * about - mass * (centre[0] ** 2 + centre[1] ** 2),
    };
  };
  /* contacts: {at, normal, bodies: [first, second]}; the normal goes from the first to the second,
     -1 is the ground M v = H r + f of velocities (x, z, turn) of each body; forces: [x, z] of each,
     beside its weight */
  const problemOf = (bodies, contacts, mu, forces = [], down = [0, -1]) => {
    const n = 3 * bodies.length;
    const m = 2 * contacts.length;
    const M = { i: [], p: [], x: [] };
    const H = { i: [], p: [], x: [] };
    const f = new Float64Array(n);
    bodies.forEach(({ mass, inertia }, b) => {
      [mass, mass, inertia].forEach((x, k) => {
        M.i.push(3 * b + k);
        M.p.push(3 * b + k);
        M.x.push(x);
      });
      plus(
        down.map((x) => x * mass * GRAVITY),
        forces[b] || [0, 0],
      ).forEach((x, k) => {
        f[3 * b + k] = STEP * x;
      });
    });
    contacts.forEach(({ at, normal: [x, z], bodies: pair }, c) =>
      pair.forEach((b, side) => {
        if (b < 0) return;
        const lever = plus(at, bodies[b].centre, -1);
        const sign = side ? 1 : -1;
        [
          [x, z],
          [z, -x],
        ].forEach((axis, k) =>
          [axis[0], axis[1], lever[0] * axis[1] - lever[1] * axis[0]].forEach((value, row) => {
            if (value) {
              H.i.push(3 * b + row);
              H.p.push(2 * c + k);
              H.x.push(sign * value);
            }
          }),
        );
      }),
    );
    const matrix = (rows, cols, { i, p, x }) => ({
      storage: "triplet",
      rows,
      cols,
      i: Int32Array.from(i),
      p: Int32Array.from(p),
      x: Float64Array.from(x),
    });
    return {
      kind: "global",
      spacedim: 2,
      M: matrix(n, n, M),
      H: matrix(n, m, H),
      f,
      w: new Float64Array(m),
      mu: new Float64Array(contacts.length).fill(mu),
    };
  };
  const solved = (fclib, problem, settings = {}) => {
    const result = fclib.solve(problem, { tol: TOLERANCE, time_limit: LIMIT, ...settings });
    if (result.status === "infeasible") return { status: result.status, result };
    return { status: result.status, result, each: fclib.contact_merits(problem, result.solution) };
  };
  const counted = ({ result, each, status }) => {
    if (!each) return "There is no solution: this is proven.";
    const of = (name) => each.status.filter((one) => one === name).length;
    return (
      `${["open", "stick", "slide"].map((name) => `${of(name)} ${name}`).join(", ")}` +
      `${status === "converged" ? "" : ` (${status}, error ${shown(result.error)})`}`
    );
  };

  const WIDTH = 640;
  const LINE = 30; // px of an arrow that has the mean size
  /* a drawing of the plane: bodies where they are, as ghosts where they go, reactions on the second
     body of a contact */
  const drawPlane = (
    box,
    { bodies, fixed = [], contacts, outcome, scale, reach, thrust = false },
  ) => {
    const [x0, z0, x1, z1] = reach;
    const factor = WIDTH / (x1 - x0);
    const to = ([x, z]) => [(x - x0) * factor, (z1 - z) * factor];
    const points = (corners) =>
      corners
        .map((p) =>
          to(p)
            .map((v) => v.toFixed(1))
            .join(","),
        )
        .join(" ");
    box.replaceChildren();
    set(box, { viewBox: `0 0 ${WIDTH} ${((z1 - z0) * factor).toFixed(0)}` });
    for (const corners of fixed)
      box.append(
        svg("polygon", { points: points(corners), fill: COLOURS.fixed, "fill-opacity": 0.35 }),
      );
    const { v, r } = outcome.each ? outcome.result.solution : {};
    for (const { corners } of bodies)
      box.append(
        svg("polygon", {
          points: points(corners),
          fill: COLOURS.body,
          "fill-opacity": 0.5,
          stroke: "currentColor",
          "stroke-width": 1,
        }),
      );
    if (!outcome.each) return;
    // where they go: not to scale, since a step is short
    bodies.forEach(({ corners, centre }, b) => {
      const [x, z, turn] = [0, 1, 2].map((k) => v[3 * b + k] * scale.way);
      if (
        Math.hypot(x, z) +
          Math.abs(turn) * Math.max(...corners.map((p) => norm(plus(p, centre, -1)))) <
        0.004 * (x1 - x0)
      )
        return;
      const moved = corners.map((p) => {
        const [a, c] = plus(p, centre, -1);
        return [centre[0] + x + a - turn * c, centre[1] + z + c + turn * a];
      });
      box.append(
        svg("polygon", {
          points: points(moved),
          fill: "none",
          stroke: COLOURS.u,
          "stroke-width": 1.5,
          "stroke-dasharray": "5 3",
        }),
      );
    });
    const joints = new Map();
    contacts.forEach(({ at, normal: [x, z], joint }, c) => {
      const [n, t] = [r[2 * c], r[2 * c + 1]];
      const force = [n * x + t * z, n * z - t * x];
      const place = to(at);
      const colour = COLOURS[outcome.each.status[c]];
      arrow(box, place, [force[0] * scale.force, -force[1] * scale.force], colour);
      box.append(svg("circle", { cx: place[0], cy: place[1], r: 4.5, fill: colour }));
      const own = joints.get(joint) || { at: [0, 0], sum: 0 };
      joints.set(joint, { at: plus(own.at, at, n), sum: own.sum + n });
    });
    if (thrust) {
      const line = [...joints.values()]
        .filter(({ sum }) => sum > 0)
        .map(({ at, sum }) =>
          to(at.map((x) => x / sum))
            .map((x) => x.toFixed(1))
            .join(","),
        );
      box.append(
        svg("polyline", {
          points: line.join(" "),
          fill: "none",
          stroke: COLOURS.r,
          "stroke-width": 2,
        }),
      );
    }
  };

  // ---- the figures: each is {sliders, draw(fclib, values, boxes) -> text}, drawn into so many
  // boxes
  const box = (x, z, width, height) => [
    [x, z],
    [x + width, z],
    [x + width, z + height],
    [x, z + height],
  ];

  const single = {
    sliders: [
      { label: "μ", min: 0, max: 1.2, step: 0.01, value: 0.6 },
      { label: "q_N", unit: "m/s", min: -1.5, max: 0.5, step: 0.01, value: -1 },
      { label: "size of q_T", unit: "m/s", min: 0, max: 2, step: 0.01, value: 1.3 },
      { label: "direction of q_T", unit: "°", min: -180, max: 180, step: 1, value: 20 },
      { label: "coupling W_NT", unit: "1/kg", min: -0.8, max: 0.8, step: 0.01, value: 0 },
    ],
    boxes: 1,
    turns: true,
    draw: (fclib, [mu, normal, tangent, direction, coupling], [picture], eye) => {
      const angle = (direction * Math.PI) / 180;
      const q = Float64Array.of(normal, tangent * Math.cos(angle), tangent * Math.sin(angle));
      const W = {
        storage: "dense",
        rows: 3,
        cols: 3,
        x: Float64Array.of(1, coupling, 0, coupling, 1, 0, 0, 0, 1),
      };
      const problem = { kind: "local", spacedim: 3, W, q, mu: Float64Array.of(mu) };
      const outcome = solved(fclib, problem);
      if (!outcome.each) return counted(outcome);
      const r = [...outcome.result.solution.r];
      const u = [...outcome.each.u];
      const hat = plus(u, [mu * Math.hypot(u[1], u[2]), 0, 0]);
      drawCone(picture, eye, mu, { r, u, hat, q: [...q] });
      const vector = (name, x, unit) =>
        `${name} = (${x.map((one) => shown(one)).join(", ")})${unit}`;
      return (
        "The contact " +
        `${{ open: "is open", stick: "sticks", slide: "slides" }[outcome.each.status[0]]}: ` +
        `${vector("r", r, " N s")}, ${vector("u", u, " m/s")}, ${vector("û", hat, " m/s")}, û ` +
        `· r = ${shown(hat[0] * r[0] + hat[1] * r[1] + hat[2] * r[2])}.`
      );
    },
  };
  const HIGH = 1.5; // of the cones [N s], [m/s]
  const drawCone = (picture, eye, mu, { r, u, hat, q }) => {
    const tall = 420;
    const unit = 115;
    const [c, s, p, t] = [
      Math.cos(eye.turn),
      Math.sin(eye.turn),
      Math.cos(eye.tilt),
      Math.sin(eye.tilt),
    ];
    // N is up; seen without perspective
    const to = ([n, x, y]) => {
      const across = c * x + s * y;
      const deep = c * y - s * x;
      return [WIDTH / 2 + unit * across, 0.6 * tall - unit * (p * n + t * deep)];
    };
    picture.replaceChildren();
    set(picture, { viewBox: `0 0 ${WIDTH} ${tall}` });
    const cone = (slope, colour, name) => {
      const high = Math.min(HIGH, HIGH / Math.max(slope, 1e-9));
      const wide = Math.min(slope * high, HIGH);
      const rim = [...Array(48)].map((_, k) => {
        const a = (k * Math.PI) / 24;
        return to([high, wide * Math.cos(a), wide * Math.sin(a)]);
      });
      const tip = to([0, 0, 0]);
      const text = (list) => list.map((at) => at.map((x) => x.toFixed(1)).join(",")).join(" ");
      rim.forEach((at, k) =>
        picture.append(
          svg("polygon", {
            points: text([tip, at, rim[(k + 1) % rim.length]]),
            fill: colour,
            "fill-opacity": 0.07,
          }),
        ),
      );
      picture.append(
        svg("polygon", {
          points: text(rim),
          fill: colour,
          "fill-opacity": 0.12,
          stroke: colour,
          "stroke-width": 1.5,
        }),
      );
      const [x, y] = rim.reduce((best, at) => (at[0] > best[0] ? at : best));
      picture.append(
        svg("text", { x: x + 6, y, fill: colour, "font-size": 16, "font-style": "italic" }, name),
      );
    };
    const floor = [
      [-1, -1],
      [1, -1],
      [1, 1],
      [-1, 1],
    ]
      .map(([x, y]) =>
        to([0, 1.6 * x, 1.6 * y])
          .map((v) => v.toFixed(1))
          .join(","),
      )
      .join(" ");
    picture.append(svg("polygon", { points: floor, fill: COLOURS.fixed, "fill-opacity": 0.13 }));
    cone(mu > 0 ? 1 / mu : Infinity, COLOURS.dual, "K*");
    cone(mu, COLOURS.cone, "K");
    const origin = to([0, 0, 0]);
    const way = (x) => plus(to(x), origin, -1);
    for (const [axis, name] of [
      [[HIGH + 0.25, 0, 0], "N"],
      [[0, 1.6, 0], "T1"],
      [[0, 0, 1.6], "T2"],
    ]) {
      const end = to(axis);
      picture.append(
        svg("line", {
          x1: origin[0],
          y1: origin[1],
          x2: end[0],
          y2: end[1],
          stroke: "currentColor",
          "stroke-width": 0.7,
        }),
      );
      picture.append(
        svg("text", { x: end[0] + 3, y: end[1] - 3, fill: "currentColor", "font-size": 13 }, name),
      );
    }
    const named = (x, name, colour, width, dashed) => {
      arrow(picture, origin, way(x), colour, width, dashed);
      if (norm(way(x)) > 12) {
        const [a, b] = to(x);
        picture.append(
          svg(
            "text",
            { x: a + 7, y: b + 5, fill: colour, "font-size": 17, "font-weight": 600 },
            name,
          ),
        );
      }
    };
    named(q, "q", COLOURS.open, 2, true);
    named(u, "u", COLOURS.u, 3);
    const [from, over] = [to(u), way(plus(hat, u, -1))];
    arrow(picture, from, over, COLOURS.hat, 1.8, true);
    if (norm(over) > 20)
      picture.append(
        svg(
          "text",
          { x: from[0] + 8, y: from[1] + over[1] / 2 + 4, fill: COLOURS.hat, "font-size": 13 },
          "μ‖u_T‖",
        ),
      );
    if (norm(plus(hat, u, -1)) > 1e-9) named(hat, "û", COLOURS.hat, 3);
    named(r, "r", COLOURS.r, 4);
  };

  const wedge = {
    sliders: [
      { label: "μ", min: 0, max: 1.5, step: 0.01, value: 0.8 },
      { label: "half angle of the groove", unit: "°", min: 8, max: 50, step: 1, value: 25 },
      { label: "pull over weight", min: 0, max: 4, step: 0.05, value: 2 },
      { label: "squeeze at the start, over weight", min: 0, max: 100, step: 1, value: 10 },
    ],
    boxes: 2,
    draw: (fclib, [mu, degrees, pull, squeeze], pictures) => {
      const angle = (degrees * Math.PI) / 180;
      const slope = Math.tan(angle);
      const low = 0.5;
      const high = 1.5;
      const wall = (z, side) => [side * slope * z, z];
      const corners = [wall(low, 1), wall(high, 1), wall(high, -1), wall(low, -1)];
      const body = bodyOf(corners);
      const contacts = [low, high].flatMap((z) =>
        [1, -1].map((side) => ({
          at: wall(z, side),
          normal: [-side * Math.cos(angle), Math.sin(angle)],
          bodies: [-1, 0],
          side,
        })),
      );
      const problem = problemOf([body], contacts, mu, [[0, pull * body.mass * GRAVITY]]);
      const fixed = [1, -1].map((side) => [
        wall(0, side),
        wall(1.7, side),
        [side * 2.4, 1.7],
        [side * 2.4, -0.25],
        [0, -0.25],
      ]);
      const weight = body.mass * GRAVITY * STEP;
      // a push of both walls along x, towards the middle
      const starts = [0, (squeeze * weight) / 4].map((force) =>
        Float64Array.from(
          contacts.flatMap(({ side }) => [
            force * Math.cos(angle),
            -side * force * Math.sin(angle),
          ]),
        ),
      );
      const outcomes = starts.map((r) =>
        solved(fclib, problem, { solver: "nsgs", guess: { r }, max_iterations: 10000 }),
      );
      outcomes.forEach((outcome, k) =>
        drawPlane(pictures[k], {
          bodies: [body],
          fixed,
          contacts,
          outcome,
          scale: { way: 3, force: (0.7 * LINE) / weight },
          reach: [-2, -0.25, 2, 2.2],
        }),
      );
      const leaves = (speed) => (speed > 1e-6 ? `it leaves at ${shown(speed)} m/s` : "it stays");
      const said = (outcome) =>
        outcome.each
          ? leaves(outcome.result.solution.v[1]) +
            ` (${counted(outcome)}; error ${shown(outcome.result.error, 2)})`
          : counted(outcome);
      return (
        `Found from no reaction: ${said(outcomes[0])}. Found from a squeeze: ` +
        `${said(outcomes[1])}. tan of the half angle is ${shown(slope)}.`
      );
    },
  };

  const stack = {
    sliders: [
      { label: "μ", min: 0, max: 1.5, step: 0.01, value: 0.3 },
      { label: "boxes", min: 1, max: 8, step: 1, value: 5 },
      {
        label: "push at the top, over the weight of a box",
        min: 0,
        max: 2,
        step: 0.01,
        value: 0.45,
      },
      { label: "slope of the ground", unit: "°", min: 0, max: 40, step: 0.5, value: 0 },
    ],
    boxes: 1,
    draw: (fclib, [mu, count, push, degrees], [picture]) => {
      const wide = 1.2;
      const high = 0.6;
      const slope = (degrees * Math.PI) / 180;
      const bodies = [...Array(count)].map((_, k) => bodyOf(box(-wide / 2, k * high, wide, high)));
      const contacts = bodies.flatMap((_, k) =>
        [-wide / 2, wide / 2].map((x) => ({
          at: [x, k * high],
          normal: [0, 1],
          bodies: [k - 1, k],
        })),
      );
      const weight = bodies[0].mass * GRAVITY;
      const forces = bodies.map((_, k) => [k === count - 1 ? push * weight : 0, 0]);
      const outcome = solved(
        fclib,
        problemOf(bodies, contacts, mu, forces, [Math.sin(slope), -Math.cos(slope)]),
      );
      drawPlane(picture, {
        bodies,
        fixed: [box(-4, -0.3, 8, 0.3)],
        contacts,
        outcome,
        scale: { way: 8, force: LINE / (STEP * weight) },
        reach: [-3.2, -0.3, 3.2, 5],
      });
      const turned = "The picture is turned with the ground; tan of its slope is ";
      return `${counted(outcome)}. ${degrees ? `${turned}${shown(Math.tan(slope))}.` : ""}`;
    },
  };

  const arch = {
    sliders: [
      { label: "thickness over mean radius", min: 0.06, max: 0.3, step: 0.002, value: 0.14 },
      { label: "μ", min: 0.1, max: 1, step: 0.01, value: 0.7 },
      { label: "stones", min: 5, max: 31, step: 2, value: 15 },
      { label: "slope of the ground", unit: "°", min: 0, max: 30, step: 0.5, value: 0 },
    ],
    boxes: 1,
    draw: (fclib, [thickness, mu, count, degrees], [picture]) => {
      const [inner, outer] = [1 - thickness / 2, 1 + thickness / 2];
      const slope = (degrees * Math.PI) / 180;
      const ray = (k) => {
        const a = (Math.PI * k) / count;
        return [Math.cos(a), Math.sin(a)];
      };
      const at = (size, k) => ray(k).map((x) => size * x);
      const bodies = [...Array(count)].map((_, k) =>
        bodyOf([at(inner, k), at(outer, k), at(outer, k + 1), at(inner, k + 1)]),
      );
      // joint k is between stone k - 1 and stone k; its normal goes along the arch
      const contacts = [...Array(count + 1)].flatMap((_, k) => {
        const [x, z] = ray(k);
        return [inner, outer].map((size) => ({
          at: at(size, k),
          normal: [-z, x],
          joint: k,
          bodies: [k - 1, k === count ? -1 : k],
        }));
      });
      const outcome = solved(
        fclib,
        problemOf(bodies, contacts, mu, [], [Math.sin(slope), -Math.cos(slope)]),
      );
      const weight = STEP * GRAVITY * bodies.reduce((all, one) => all + one.mass, 0);
      drawPlane(picture, {
        bodies,
        fixed: [box(-1.6, -0.15, 1, 0.15), box(0.6, -0.15, 1, 0.15)],
        contacts,
        outcome,
        scale: { way: 2.5, force: (3 * LINE) / weight },
        reach: [-1.6, -0.15, 1.6, 1.25],
        thrust: true,
      });
      const fastest = outcome.each ? Math.max(...outcome.result.solution.v.map(Math.abs)) : 0;
      return (
        `${counted(outcome)}. ` +
        `${outcome.each ? (fastest > 1e-6 * GRAVITY * STEP ? "It falls." : "It stands.") : ""}`
      );
    },
  };

  // ---- the page
  const alive = (place, fclib, { sliders, boxes, turns, draw }) => {
    const next = place.nextElementSibling;
    const image = next && (next.matches("img") ? next : next.querySelector("img"));
    const eye = { turn: 0.55, tilt: 0.42 };
    const pictures = [...Array(boxes)].map(() =>
      svg("svg", { role: "img", "aria-label": image?.alt || "", viewBox: `0 0 ${WIDTH} 400` }),
    );
    const said = make("p", { role: "status", class: "contact-says" });
    const update = () => {
      try {
        said.textContent = draw(
          fclib,
          controls.map((one) => one.value),
          pictures,
          eye,
        );
      } catch (error) {
        said.textContent = error.message;
      }
    };
    const controls = sliders.map((one) => slider(one, update));
    place.replaceChildren(
      make("div", { class: "contact-pictures" }, ...pictures),
      make("div", { class: "contact-sliders" }, ...controls.map((one) => one.element)),
      said,
    );
    if (turns) {
      const [picture] = pictures;
      set(picture, { tabindex: 0 });
      picture.style.touchAction = "pan-y";
      picture.addEventListener("pointerdown", (event) =>
        picture.setPointerCapture(event.pointerId),
      );
      picture.addEventListener("pointermove", (event) => {
        if (!event.buttons) return;
        eye.turn += event.movementX / 120;
        eye.tilt = Math.min(1.4, Math.max(0, eye.tilt + event.movementY / 120));
        update();
      });
      picture.addEventListener("keydown", (event) => {
        const [turn, tilt] = {
          ArrowLeft: [-0.1, 0],
          ArrowRight: [0.1, 0],
          ArrowUp: [0, 0.1],
          ArrowDown: [0, -0.1],
        }[event.key] || [0, 0];
        if (!turn && !tilt) return;
        event.preventDefault();
        eye.turn += turn;
        eye.tilt = Math.min(1.4, Math.max(0, eye.tilt + tilt));
        update();
      });
    }
    update();
    if (image) next.hidden = true;
    place.dataset.alive = "";
  };
  const start = async () => {
    const places = [...document.querySelectorAll("div.contact-figure")];
    if (!places.length) return;
    const note = (text) =>
      places.forEach((place) => place.replaceChildren(make("p", { class: "contact-says" }, text)));
    if (location.protocol === "file:") {
      note(
        "A picture: a browser loads no module from a folder of files. “python -m http.server " +
          "--bind 127.0.0.1” in this folder serves it to this machine; there the figure has " +
          "sliders.",
      );
      return;
    }
    if (!BUILT) {
      note(
        "A picture: this site was built without the module for browsers (make wasm), which " +
          "makes it a figure with sliders.",
      );
      return;
    }
    try {
      const { load } = await import(new URL(MODULE, document.baseURI).href);
      const fclib = await load();
      for (const place of places)
        alive(place, fclib, { single, wedge, stack, arch }[place.dataset.figure]);
    } catch (error) {
      note(`A picture: the module for browsers did not load (${error.message}).`);
    }
  };
  start();
})();
