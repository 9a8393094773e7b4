// what if: sliders change a problem, its solution is followed by warm starts, the picture shows it
"use strict";
(() => {
  const { h, number } = Fclib;
  const STATUS = ["open", "stick", "slide"];
  const TOLERANCE = 1e-8; // of a solution that is followed, if nothing else is given
  const LIMIT = 2; // [s] of a solve
  // what a mass or a frame may differ from those of a rigid body; network.py has the same
  const RIGID = 1e-6;
  const WINDOW = 1000; // [ms] over which solves and pictures are counted

  /* N, T1, T2 of each contact in the world, if the problem or the picture says it */
  const framesOf = (problem, view) => {
    const { contacts } = problem;
    const network = (view && view.network) || {};
    const axis = (list, k) => [0, 1, 2].map((i) => list[3 * k + i]);
    const normal = (k) => (contacts ? axis(contacts.normal, k) : network.normals[k]);
    const tangent = (k) => (contacts ? axis(contacts.tangent, k) : network.tangents[k]);
    if (!contacts && !(network.normals && network.tangents)) return null;
    return Array.from(problem.mu, (_, k) => {
      const [n, t] = [normal(k), tangent(k)];
      return [
        n,
        t,
        [n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]],
      ];
    });
  };
  /* what a live picture is shown: reactions by contact, as forces in space if frames are known
   */
  Fclib.shower = (problem, view) => {
    const d = problem.spacedim;
    const parts = d === 2 || (d === 3 && "mu_r" in problem) ? 2 : 3;
    const frames = framesOf(problem, view);
    return (r, status, mu = problem.mu) => {
      const reactions = Array.from(mu, (_, k) => Array.from(r.slice(d * k, d * k + parts)));
      return {
        mu,
        status,
        reactions,
        forces:
          frames &&
          reactions.map((own, k) =>
            [0, 1, 2].map((i) => own.reduce((all, x, j) => all + x * frames[k][j][i], 0)),
          ),
      };
    };
  };
  /* statuses as a picture has them: one digit a contact */
  Fclib.digits = (names) => names.map((name) => STATUS.indexOf(name)).join("");

  /* rows of f that are forces along x, y, z (x, z in a plane), by body; null if the bodies are
     not free and rigid */
  const forceRows = async (fclib, problem) => {
    if (!("f" in problem)) return null;
    const d = problem.spacedim;
    const flat = d === 2 || (d === 3 && "mu_r" in problem);
    const size = flat ? 3 : 6;
    const linear = flat ? 2 : 3;
    const { M, H, f } = await fclib.with_storage(problem, "triplet");
    if (f.length % size) return null;
    const mass = new Float64Array(f.length);
    for (const [e, x] of M.x.entries()) {
      const row = M.i[e];
      const column = M.p[e];
      if (x === 0) continue;
      if (
        (Math.min(row % size, column % size) < linear && row !== column) ||
        Math.floor(row / size) !== Math.floor(column / size)
      )
        return null;
      if (row === column) mass[row] += x;
    }
    // the normal of a contact has length one at each body that it touches
    const lengths = new Map();
    for (const [e, x] of H.x.entries())
      if (H.p[e] % d === 0 && H.i[e] % size < linear) {
        const key = H.p[e] * f.length + Math.floor(H.i[e] / size);
        lengths.set(key, (lengths.get(key) || 0) + x * x);
      }
    for (const length of lengths.values())
      if (length > RIGID && Math.abs(length - 1) > RIGID) return null;
    const bodies = [];
    for (let first = 0; first < f.length; first += size) {
      if (
        Array.from({ length: linear }, (_, k) => mass[first + k]).some(
          (m) => Math.abs(m - mass[first]) > RIGID * mass[first],
        )
      )
        return null;
      bodies.push(first);
    }
    return { bodies, flat };
  };

  const DEGREE = Math.PI / 180;
  const turned = (f, { bodies, flat }, size, turn, tilt) => {
    const found = f.map((x) => size * x);
    const [c, s] = [Math.cos(turn * DEGREE), Math.sin(turn * DEGREE)];
    const [p, q] = [Math.cos(tilt * DEGREE), Math.sin(tilt * DEGREE)];
    for (const k of bodies) {
      const up = k + (flat ? 1 : 2);
      const x = found[k];
      const z = found[up];
      [found[k], found[up]] = [c * x + s * z, c * z - s * x];
      if (!flat) {
        const y = found[k + 1];
        const over = found[up];
        [found[k + 1], found[up]] = [p * y + q * over, p * over - q * y];
      }
    }
    return found;
  };

  /* its values are those of the input times `scale`, which keeps nought nought */
  const slider = (label, unit, { min, max, step, value, scale = 1 }, act) => {
    const shown = h("output", {});
    const input = h("input", {
      type: "range",
      min,
      max,
      step,
      value,
      "aria-label": label,
      oninput: () => {
        tell();
        act(scale * Number(input.value));
      },
    });
    const tell = () => {
      shown.textContent = `${label} ${number(scale * Number(input.value))}${unit && ` ${unit}`}`;
    };
    tell();
    return {
      element: h("div", { class: "range" }, shown, input),
      put: (v) => {
        input.value = v / scale;
        tell();
      },
    };
  };

  /* the panel; fclib is the module in its worker, figure a live picture or null */
  Fclib.whatIf = async (fclib, problem, solution, view, figure, solvers, say) => {
    const whole = "f" in problem;
    const d = problem.spacedim;
    const nc = problem.mu.length;
    const sizes = await fclib.validate(problem);
    // the velocities without reactions
    const { u: free } = await fclib.contact_merits(problem, {
      r: new Float64Array(sizes.m),
      ...(sizes.p ? { l: new Float64Array(sizes.p) } : {}),
    });
    const most = free.reduce((all, x) => Math.max(all, Math.abs(x)), 0) || 1;
    const rows = await forceRows(fclib, problem);
    const shown = Fclib.shower(problem, view);
    const highest = problem.mu.reduce((all, x) => Math.max(all, x), 0);
    const { contacts, bodies, ...bare } = problem; // what is solved
    const stored = solution && { r: solution.r, ...(sizes.p ? { l: solution.l } : {}) };
    let chosen = null;
    let solver = "auto";
    let state;
    let last = stored;
    let anew = false;
    let reference = null;
    const fresh = () => ({
      mu: null,
      muOf: new Map(),
      gap: 0,
      gapOf: new Map(),
      size: 1,
      turn: 0,
      tilt: 0,
    });
    state = fresh();
    const told = h("p", { class: "small", role: "status" });
    const rate = h("p", { class: "small soft" });

    const changed = () => {
      const mu = Float64Array.from(problem.mu, (own, k) => state.muOf.get(k) ?? state.mu ?? own);
      const name = whole ? "w" : "q";
      const load = whole
        ? {
            f: rows
              ? turned(problem.f, rows, state.size, state.turn, state.tilt)
              : problem.f.map((x) => state.size * x),
          }
        : {};
      const shift = Float64Array.from(problem[name], (x) => (whole ? x : state.size * x));
      for (let k = 0; k < nc; k++) shift[d * k] += state.gap + (state.gapOf.get(k) || 0);
      return { ...bare, mu, ...load, [name]: shift };
    };
    const times = { solves: [], pictures: [] };
    const count = (list) => {
      const now = performance.now();
      list.push(now);
      while (list[0] < now - WINDOW) list.shift();
      return list.length;
    };
    let busy = false;
    let again = false;
    const follow = async () => {
      again = true;
      if (busy) return;
      busy = true;
      box.setAttribute("aria-busy", "true");
      try {
        while (again) {
          again = false;
          if (anew) [last, anew] = [stored, false]; // of several solutions, the one at first
          const own = changed();
          const began = performance.now();
          const result = await fclib.solve(own, {
            solver,
            tol: TOLERANCE,
            time_limit: LIMIT,
            guess: last,
          });
          const passed = performance.now() - began;
          if (result.status === "infeasible") {
            told.className = "small bad";
            told.textContent = "There is no solution: this is proven.";
            continue;
          }
          const each = await fclib.contact_merits(own, result.solution);
          const digits = Fclib.digits(each.status);
          const counts = STATUS.map(
            (_, s) => [...digits].filter((one) => Number(one) === s).length,
          );
          if (result.converged)
            last = { r: result.solution.r, ...(sizes.p ? { l: result.solution.l } : {}) };
          reference ||= counts;
          told.className = result.converged ? "small" : "small bad";
          const more = counts.map((one, s) => one - reference[s]);
          const change = (by) => (by ? ` (${by > 0 ? "+" : "−"}${Math.abs(by)})` : "");
          told.textContent =
            STATUS.map((name, s) => `${counts[s]} ${name}${change(more[s])}`).join(", ") +
            `; ${result.converged ? "" : `not solved, ${result.status}: `}error ` +
            `${number(result.error)}, ${Fclib.count(result.iterations, "iteration")}`;
          const solves = count(times.solves);
          if (figure)
            figure.show(shown(result.solution.r, digits, own.mu)).then(() => count(times.pictures));
          rate.textContent =
            `A solve took ${number(passed, 2)} ms, with the way to the worker and back. In the ` +
            `last second: solves ${solves}` +
            `${figure ? `, pictures ${times.pictures.length}` : ""}.`;
        }
      } catch (error) {
        if (told.isConnected) {
          told.className = "small bad";
          told.textContent = error.message;
        }
      } finally {
        busy = false;
        box.setAttribute("aria-busy", "false");
      }
    };
    const set = (key, of) => (value) => {
      if (chosen !== null && of) state[of].set(chosen, value);
      else {
        state[key] = value;
        if (of) state[of].clear();
      }
      follow();
    };
    const mu = slider(
      "μ",
      "",
      { min: 0, max: Math.max(1, 1.5 * highest), step: 0.01, value: highest },
      set("mu", "muOf"),
    );
    const gap = slider(
      "gap over time step",
      "m/s",
      { min: -200, max: 200, step: 1, value: 0, scale: most / 100 },
      set("gap", "gapOf"),
    );
    const size = slider(
      `size of ${whole ? "f" : "q"}`,
      "",
      { min: 0, max: 3, step: 0.02, value: 1 },
      set("size"),
    );
    const turn =
      rows &&
      slider("turn of f, from z to x", "°", { min: -90, max: 90, step: 1, value: 0 }, set("turn"));
    const tilt =
      rows &&
      !rows.flat &&
      slider("turn of f, from z to y", "°", { min: -90, max: 90, step: 1, value: 0 }, set("tilt"));
    const put = () => {
      mu.put(
        chosen === null
          ? (state.mu ?? highest)
          : (state.muOf.get(chosen) ?? state.mu ?? problem.mu[chosen]),
      );
      gap.put(chosen === null ? state.gap : state.gapOf.get(chosen) || 0);
      size.put(state.size);
      if (turn) turn.put(state.turn);
      if (tilt) tilt.put(state.tilt);
    };
    const one = h("input", {
      type: "number",
      min: 0,
      max: nc - 1,
      step: 1,
      placeholder: "all",
      oninput: () => {
        const k = one.value === "" ? null : Number(one.value);
        const known = k === null || (Number.isInteger(k) && k >= 0 && k < nc);
        say(
          known
            ? ""
            : `contact: there is none of the number ${one.value}; they go from 0 to ${nc - 1}`,
        );
        if (known) {
          chosen = k;
          put();
        }
      },
    });
    const method = h(
      "select",
      {
        onchange: () => {
          solver = method.value;
          follow();
        },
      },
      solvers.map(({ name }) => h("option", { value: name, selected: name === solver }, name)),
    );
    const reset = h(
      "button",
      {
        type: "button",
        onclick: () => {
          state = fresh();
          anew = true;
          one.value = "";
          chosen = null;
          put();
          say("");
          follow();
        },
      },
      "Reset",
    );
    const box = h(
      "div",
      { class: "panel what-if" },
      h("h3", {}, "What if"),
      h(
        "div",
        { class: "controls" },
        h("label", {}, "μ and gap of contact", one),
        h("label", {}, "solver", method),
        reset,
      ),
      h(
        "div",
        { class: "ranges" },
        mu.element,
        gap.element,
        size.element,
        turn && turn.element,
        tilt && tilt.element,
      ),
      told,
      rate,
      h(
        "details",
        {},
        h("summary", {}, "What the sliders change"),
        h(
          "p",
          { class: "small soft" },
          `μ of all contacts starts at the file's own, up to ${number(highest)}, and is one ` +
            "value once it is moved. The gap over the time step is added to the normal part of " +
            `${whole ? "w" : "q"}. `,
          whole
            ? rows
              ? "The size multiplies f, the momentum without reactions: weight and earlier " +
                "motion alike; the turn turns its forces on each body, and leaves its moments. " +
                "w stays."
              : "The size multiplies f, the momentum without reactions. It cannot be turned: " +
                "the bodies are not free and rigid."
            : "The size multiplies q, the velocity of the contacts without reactions. A local " +
                "problem has no forces that could be turned: its global form has.",
          ` Each solution starts from the one before, to ${TOLERANCE.toExponential()}; Reset ` +
            "starts from the stored one, if there is one.",
        ),
      ),
    );
    follow();
    return box;
  };
})();
