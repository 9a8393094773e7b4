// the network of contacts in space, on a canvas: turned by drag or arrows, zoomed by wheel, pinch or + and -
"use strict";
(() => {
  const { h, number } = Fclib;
  const STATUS = ["open", "stick", "slide"];
  const length = (x) => Math.hypot(...x);
  const hull = (points) => { // Andrew's monotone chain
    points.sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const turn = (o, a, b) => (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    const half = (list) => {
      const found = [];
      for (const p of list) {
        while (found.length > 1 && turn(found[found.length - 2], found[found.length - 1], p) <= 0) found.pop();
        found.push(p);
      }
      found.pop();
      return found;
    };
    return points.length < 3 ? points : [...half(points), ...half([...points].reverse())];
  };

  Fclib.scene = (view) => {
    const net = view.network, count = net.points.length;
    const own = net.bodies.map(() => []);
    net.pairs.forEach((pair, k) => pair.forEach((b) => { if (b >= 0) own[b].push(k); }));
    const solved = Boolean(view.reactions);
    const sizes = solved ? view.reactions.map(length) : [];
    const largest = Math.max(1e-300, ...sizes);
    // the middle and the size of all that is drawn
    const all = [...net.points, ...net.bodies];
    const low = [0, 1, 2].map((k) => Math.min(...all.map((p) => p[k]))), high = [0, 1, 2].map((k) => Math.max(...all.map((p) => p[k])));
    const middle = low.map((x, k) => (x + high[k]) / 2), radius = Math.max(1e-12, 0.5 * length(high.map((x, k) => x - low[k])));
    const gap = radius / Math.cbrt(Math.max(1, net.bodies.length || count));
    const shown = { bodies: true, points: true, normals: !solved && net.placed, reactions: solved, scale: 1 };
    const start = { turn: -0.6, tilt: net.placed ? 0.25 : 0.4, zoom: 1, x: 0, y: 0 };
    const eye = { ...start };

    const canvas = h("canvas", {
      tabindex: 0, role: "img",
      "aria-label": `Contact network: ${net.bodies.length} bodies, ${count} contacts. Arrows turn, plus and minus zoom, 0 resets; a table follows.`,
    });
    const draw = () => {
      const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
      if (!width) return;
      if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
      if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
      const c = canvas.getContext("2d");
      c.setTransform(ratio, 0, 0, ratio, 0, 0);
      c.clearRect(0, 0, width, height);
      const [ct, st, cp, sp] = [Math.cos(eye.turn), Math.sin(eye.turn), Math.cos(eye.tilt), Math.sin(eye.tilt)];
      // a box that is tall is fitted by its height, a flat one by its width
      const wide = Math.hypot(high[0] - low[0], high[1] - low[1]) / 2, tall = (high[2] - low[2]) / 2 * cp + wide * sp;
      const fit = 0.92 * Math.min(width / 2 / Math.max(wide, 1e-12), height / 2 / Math.max(tall, 1e-12)) * eye.zoom;
      const far = 6 * radius;
      const project = (p) => {
        const x = p[0] - middle[0], y = p[1] - middle[1], z = p[2] - middle[2];
        const a = ct * x + st * y, b = -st * x + ct * y;
        const depth = cp * b - sp * z, up = sp * b + cp * z; // depth grows away from the eye
        const f = fit * far / (far + depth);
        return [width / 2 + eye.x + a * f, height / 2 + eye.y - up * f, depth, f];
      };
      const names = ["body", "force", "normal", "soft", "back", "text", "open", "stick", "slide"];
      const colour = Object.fromEntries(names.map((name) => [name, Fclib.colour(name)]));
      const points = net.points.map(project), bodies = net.bodies.map(project);
      const near = (depth) => 1 - 0.55 * Math.min(1, Math.max(0, (depth + radius) / (2 * radius)));
      if (net.placed && low[2] < high[2] && net.pairs.some((pair) => pair[1] < 0)) ground(c, project, colour.soft);
      const things = [];
      if (shown.bodies) bodies.forEach((p, b) => things.push([p[2], () => {
        c.globalAlpha = near(p[2]);
        c.strokeStyle = c.fillStyle = colour.body;
        const corners = own[b].map((k) => points[k]);
        if (net.radii[b] > 0) {
          const r = net.radii[b] * p[3], shade = c.createRadialGradient(p[0] - r / 3, p[1] - r / 3, r / 6, p[0], p[1], r);
          shade.addColorStop(0, colour.back); shade.addColorStop(1, colour.body);
          c.fillStyle = shade; c.globalAlpha *= 0.55;
          c.beginPath(); c.arc(p[0], p[1], r, 0, 7); c.fill(); c.stroke();
          return;
        }
        const outline = hull([[p[0], p[1]], ...corners.map((q) => [q[0], q[1]])]);
        if (outline.length > 2 && net.placed) {
          c.save(); c.globalAlpha *= 0.3;
          c.beginPath(); outline.forEach((q, k) => c[k ? "lineTo" : "moveTo"](q[0], q[1])); c.closePath(); c.fill();
          c.restore();
          c.lineWidth = 1; c.globalAlpha *= 0.8; c.stroke();
        }
        c.lineWidth = 0.8; c.globalAlpha = 0.4 * near(p[2]);
        c.beginPath(); corners.forEach((q) => { c.moveTo(p[0], p[1]); c.lineTo(q[0], q[1]); }); c.stroke();
        c.globalAlpha = near(p[2]);
        c.beginPath(); c.arc(p[0], p[1], Math.min(7, Math.max(2, 0.09 * gap * p[3])), 0, 7); c.fill();
      }]));
      points.forEach((p, k) => things.push([p[2] - 1e-6 * radius, () => {
        c.globalAlpha = near(p[2]);
        const status = view.status ? STATUS[view.status[k]] : "normal";
        if (shown.normals && net.normals) {
          const tip = project(net.points[k].map((x, i) => x + 0.35 * gap * net.normals[k][i]));
          c.strokeStyle = colour.normal; c.lineWidth = 1;
          c.beginPath(); c.moveTo(p[0], p[1]); c.lineTo(tip[0], tip[1]); c.stroke();
        }
        if (shown.reactions && sizes[k] > 0) {
          c.strokeStyle = c.fillStyle = colour.force;
          if (view.forces) arrow(c, project, net.points[k], view.forces[k].map((x) => (view.forces[k][2] > 0 ? -x : x) / largest * 1.4 * gap * shown.scale));
          else { // a graph has no directions: the thickness is the size
            c.lineWidth = Math.max(0.4, 9 * shown.scale * sizes[k] / largest);
            c.beginPath();
            const ends = net.pairs[k].filter((b) => b >= 0);
            if (ends.length) for (const b of ends) { c.moveTo(p[0], p[1]); c.lineTo(bodies[b][0], bodies[b][1]); }
            c.stroke();
            if (!ends.length) { c.beginPath(); c.arc(p[0], p[1], Math.max(2.5, 14 * Math.sqrt(shown.scale * sizes[k] / largest)), 0, 7); c.globalAlpha *= 0.5; c.fill(); c.globalAlpha = near(p[2]); }
          }
        }
        if (shown.points) {
          c.fillStyle = colour[status]; c.strokeStyle = colour.back; c.lineWidth = 0.7;
          c.beginPath(); c.arc(p[0], p[1], picked === k ? 7 : Math.max(1.8, Math.min(4, 0.05 * gap * p[3]) + 1), 0, 7); c.fill(); c.stroke();
          if (picked === k) { c.strokeStyle = colour.text; c.lineWidth = 2; c.stroke(); }
        }
      }]));
      things.sort((a, b) => b[0] - a[0]).forEach(([, paint]) => paint());
      c.globalAlpha = 1;
      flat = points;
    };
    const ground = (c, project, colour) => {
      const step = 10 ** Math.round(Math.log10(radius / 3)), pad = 0.15 * radius;
      c.strokeStyle = colour; c.globalAlpha = 0.22; c.lineWidth = 1; c.beginPath();
      const [x0, x1, y0, y1] = [low[0] - pad, high[0] + pad, low[1] - pad, high[1] + pad];
      const every = Math.max(step, (Math.max(x1 - x0, y1 - y0)) / 24);
      for (let x = x0; x <= x1 + 1e-9; x += every) { const a = project([x, y0, low[2]]), b = project([x, y1, low[2]]); c.moveTo(a[0], a[1]); c.lineTo(b[0], b[1]); }
      for (let y = y0; y <= y1 + 1e-9; y += every) { const a = project([x0, y, low[2]]), b = project([x1, y, low[2]]); c.moveTo(a[0], a[1]); c.lineTo(b[0], b[1]); }
      c.stroke();
    };
    const arrow = (c, project, from, vector) => {
      const a = project(from), b = project(from.map((x, k) => x + vector[k]));
      const dx = b[0] - a[0], dy = b[1] - a[1], size = Math.hypot(dx, dy);
      c.lineWidth = Math.min(3, 0.8 + size / 40);
      c.beginPath(); c.moveTo(a[0], a[1]); c.lineTo(b[0], b[1]); c.stroke();
      if (size < 3) return;
      const head = Math.min(9, 0.4 * size), ux = dx / size, uy = dy / size;
      c.beginPath(); c.moveTo(b[0], b[1]); c.lineTo(b[0] - head * ux + 0.45 * head * uy, b[1] - head * uy - 0.45 * head * ux);
      c.lineTo(b[0] - head * ux - 0.45 * head * uy, b[1] - head * uy + 0.45 * head * ux); c.closePath(); c.fill();
    };

    // ---- hands
    let flat = [], picked = -1, queued = false;
    const later = () => { if (!queued) { queued = true; requestAnimationFrame(() => { queued = false; draw(); }); } };
    const zoom = (factor) => { eye.zoom = Math.min(60, Math.max(0.2, eye.zoom * factor)); eye.x *= factor; eye.y *= factor; later(); };
    const held = new Map();
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); held.set(event.pointerId, event); });
    canvas.addEventListener("pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (!before) { hover(event); return; }
      const dx = event.clientX - before.clientX, dy = event.clientY - before.clientY;
      if (held.size === 2) {
        const other = [...held.values()].find((e) => e.pointerId !== event.pointerId);
        const span = (e) => Math.hypot(e.clientX - other.clientX, e.clientY - other.clientY);
        zoom(span(event) / Math.max(1, span(before)));
        eye.x += dx / 2; eye.y += dy / 2;
      } else if (event.shiftKey || event.buttons === 2) { eye.x += dx; eye.y += dy; }
      else { eye.turn -= dx * 0.008; eye.tilt = Math.min(1.57, Math.max(-1.57, eye.tilt + dy * 0.008)); }
      held.set(event.pointerId, event);
      later();
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => held.delete(event.pointerId));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(-event.deltaY * 0.0015)); }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const moves = { ArrowLeft: () => { eye.turn -= 0.1; }, ArrowRight: () => { eye.turn += 0.1; }, ArrowUp: () => { eye.tilt = Math.min(1.57, eye.tilt + 0.1); }, ArrowDown: () => { eye.tilt = Math.max(-1.57, eye.tilt - 0.1); },
        "+": () => zoom(1.2), "=": () => zoom(1.2), "-": () => zoom(1 / 1.2), 0: () => Object.assign(eye, start) };
      if (!(event.key in moves)) return;
      event.preventDefault(); moves[event.key](); later();
    });
    const says = h("p", { class: "small soft", "aria-live": "polite" }, " ");
    const body = (b) => b < 0 ? "the ground" : `body ${b}`;
    const pick = (k) => {
      if (k === picked) return;
      picked = k;
      says.textContent = k < 0 ? " " : `contact ${k}` + (net.bodies.length ? `: ${body(net.pairs[k][0])} and ${body(net.pairs[k][1])}` : "") +
        `, μ = ${number(view.mu[k])}` + (solved ? `, ${STATUS[view.status[k]]}, reaction ${number(view.reactions[k][0])} along the normal and ${number(length(view.reactions[k].slice(1)))} across` : "");
      later();
    };
    const hover = (event) => {
      const box = canvas.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
      let best = -1, least = 144;
      flat.forEach((p, k) => { const d = (p[0] - x) ** 2 + (p[1] - y) ** 2; if (d < least) { least = d; best = k; } });
      pick(best);
    };

    // ---- controls
    const check = (name, label, there) => there && h("label", { class: "check" }, h("input", { type: "checkbox", checked: shown[name], onchange: (event) => { shown[name] = event.target.checked; later(); } }), label);
    const controls = h("div", { class: "controls" },
      check("bodies", "bodies", net.bodies.length > 0), check("points", "contact points", true),
      check("normals", "normals", Boolean(net.normals)), check("reactions", "reactions", solved),
      solved && h("label", {}, "scale of reactions", h("input", { type: "range", min: -2, max: 2, step: 0.1, value: 0, "aria-label": "Scale of reactions", oninput: (event) => { shown.scale = 4 ** Number(event.target.value); later(); } })),
      h("button", { type: "button", onclick: () => zoom(1.25), "aria-label": "Zoom in" }, "+"),
      h("button", { type: "button", onclick: () => zoom(0.8), "aria-label": "Zoom out" }, "−"),
      h("button", { type: "button", onclick: () => { Object.assign(eye, start); later(); } }, "reset"));
    const key = solved && h("ul", { class: "legend" }, STATUS.map((name, k) => h("li", {}, h("span", { class: "key", style: `background: var(--${name})` }), `${name} (${[...view.status].filter((s) => Number(s) === k).length})`)));
    const rows = net.points.map((_, k) => ({ k }));
    const columns = [{ key: "k", label: "contact", head: true },
      ...net.bodies.length ? [0, 1].map((side) => ({ key: `body${side}`, label: side ? "and body" : "body", value: (row) => net.pairs[row.k][side], format: (b) => b < 0 ? "ground" : String(b) })) : [],
      { key: "mu", label: "μ", type: "number", value: (row) => view.mu[row.k] },
      ...solved ? [{ key: "status", label: "status", value: (row) => STATUS[view.status[row.k]] },
        { key: "rn", label: "r_N", type: "number", value: (row) => view.reactions[row.k][0] },
        { key: "rt", label: "‖r_T‖", type: "number", value: (row) => length(view.reactions[row.k].slice(1)) }] : []];
    const table = h("details", {}, h("summary", {}, "The contacts as a table"));
    table.addEventListener("toggle", () => { if (table.open && table.children.length === 1) table.append(Fclib.table({ caption: "Contacts", columns, rows, page: 25, largest: true })); });
    new ResizeObserver(later).observe(canvas);
    document.addEventListener("fclib-theme", later);
    const figure = h("figure", { class: "scene" }, controls, canvas, says, key,
      h("figcaption", {}, net.placed ? `To scale: ${net.note}.` : `Not to scale, laid out ${net.note}.`,
        net.placed && net.bodies.length > 0 && " A body is drawn as the hull of its centre and its contacts, or as a ball where these say so.",
        solved && view.forces && " An arrow is the reaction on that side of a contact which it presses down."), table);
    figure.eye = eye;
    return figure;
  };
})();
