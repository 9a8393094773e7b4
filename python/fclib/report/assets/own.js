// what the picture of a visitor's own file is drawn from: as view.py has it, made in the browser
"use strict";
(() => {
  const LAID_OUT = 400; // contacts up to which a problem without positions is laid out
  const ROUNDS = 60; // of laying out
  const DETAIL = [
    [3000, 3, 6],
    [600, 5, 8],
    [100, 7, 12],
    [0, 10, 20],
  ]; // from so many round shapes on: latitudes, longitudes; solids.py has the same
  const [PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH] = [0, 1, 2, 3, 4, 5, 6];
  const rows = (values, width) =>
    Array.from({ length: values.length / width }, (_, k) =>
      Array.from(values.slice(width * k, width * (k + 1))),
    );
  const times = ([w, x, y, z], [p, q, r, s]) => [
    w * p - x * q - y * r - z * s,
    w * q + x * p + y * s - z * r,
    w * r - x * s + y * p + z * q,
    w * s + x * r - y * q + z * p,
  ];
  const turned = (turn, v) =>
    times(times(turn, [0, ...v]), [turn[0], -turn[1], -turn[2], -turn[3]]).slice(1);

  // ---- solids of the tables of a file, as solids.py makes them
  const triangles = (faces) =>
    faces.flatMap(([a, b, c, d]) =>
      d >= 0
        ? [
            [a, b, c],
            [a, c, d],
          ]
        : [[a, b, c]],
    );
  const unit = (kind, latitudes, longitudes) => {
    const sides = [-1, 1];
    if (kind === PLANE)
      return [
        [
          [-1, -1, 0, 0],
          [1, -1, 0, 0],
          [1, 1, 0, 0],
          [-1, 1, 0, 0],
        ],
        [
          [0, 1, 2],
          [0, 2, 3],
        ],
      ];
    if (kind === BOX)
      return [
        sides.flatMap((x) => sides.flatMap((y) => sides.map((z) => [x, y, z, 0]))),
        triangles([
          [0, 1, 3, 2],
          [4, 6, 7, 5],
          [0, 4, 5, 1],
          [2, 3, 7, 6],
          [0, 2, 6, 4],
          [1, 5, 7, 3],
        ]),
      ];
    const half = Math.floor(latitudes / 2) + 1;
    const angles = [...Array(half + 1)].map((_, k) => ((Math.PI / 2) * k) / half);
    const lower = angles.map((a) => [Math.sin(a), -Math.cos(a), -1]);
    const upper = [...angles].reverse().map((a) => [Math.sin(a), Math.cos(a), 1]);
    const rings =
      kind === CYLINDER
        ? [
            [0, -1, 0],
            [1, -1, 0],
            [1, 1, 0],
            [0, 1, 0],
          ]
        : [...lower, ...(kind === CAPSULE ? upper : upper.slice(1))];
    const vertices = rings.flatMap(([r, z, t]) =>
      [...Array(longitudes)].map((_, k) => {
        const a = (2 * Math.PI * k) / longitudes;
        return [r * Math.cos(a), r * Math.sin(a), z, t];
      }),
    );
    const faces = rings.slice(1).flatMap((_, i) =>
      [...Array(longitudes)].map((__, j) => {
        const [a, b] = [i * longitudes + j, i * longitudes + ((j + 1) % longitudes)];
        return [a, b, b + longitudes, a + longitudes];
      }),
    );
    return [vertices, triangles(faces)];
  };
  const solidsOf = (bodies, contacts) => {
    const places = rows(bodies.place, 3);
    const turns = rows(bodies.turn, 4);
    const sizes = rows(bodies.shape_size, 3);
    const kinds = [...bodies.shape_kind];
    const body = [...bodies.shape_body];
    const ownPlaces = rows(bodies.shape_place, 3);
    const ownTurns = rows(bodies.shape_turn, 4);
    const place = body.map((b, k) =>
      turned(turns[b], ownPlaces[k]).map((x, i) => x + places[b][i]),
    );
    const turn = body.map((b, k) => times(turns[b], ownTurns[k]));
    const rounds = kinds.filter((kind) =>
      [SPHERE, CAPSULE, ELLIPSOID, CYLINDER].includes(kind),
    ).length;
    const [, latitudes, longitudes] = DETAIL.find(([least]) => rounds >= least);
    // how far a plane without an end is drawn: beyond all that moves
    const largest = (list) => list.reduce((most, x) => Math.max(most, Math.abs(x)), 0);
    const held = contacts ? rows(contacts.shape, 2) : [];
    const seen = [
      ...place.filter((_, k) => bodies.moves[body[k]]),
      ...(contacts ? rows(contacts.point, 3).filter((_, k) => Math.min(...held[k]) >= 0) : []),
    ];
    const span =
      1.3 *
        (largest(seen.flat()) +
          Math.min(
            sizes.reduce((most, size) => Math.max(most, ...size), 0),
            1,
          )) || 1;
    const meshes = [];
    const strain = {};
    const known = new Map();
    const first = bodies.mesh_first ? rows(bodies.mesh_first, 2) : [];
    const vertices = bodies.vertex ? rows(bodies.vertex, 3) : [];
    const faces = bodies.face ? rows(bodies.face, 4) : [];
    const displacement = bodies.displacement ? rows(bodies.displacement, 3) : [];
    const kind = kinds.map((one, k) => {
      const mesh = one === MESH ? bodies.shape_mesh[k] : -1;
      const key = one === MESH ? `mesh ${mesh}` : String(one);
      if (!known.has(key)) {
        known.set(key, meshes.length);
        if (one === MESH) {
          const [[v, f], [w, g]] = [first[mesh], first[mesh + 1]];
          const moved = displacement.slice(v, w).map((x) => Math.hypot(...x));
          if (moved.some((x) => x)) strain[meshes.length] = moved;
          meshes.push([vertices.slice(v, w).map((x) => [...x, 0]), triangles(faces.slice(f, g))]);
        } else meshes.push(unit(one, latitudes, longitudes));
      }
      return known.get(key);
    });
    const scale = kinds.map((one, k) => {
      const [a, b, c] = sizes[k];
      return one === PLANE
        ? [a || span, b || span, 0, 0]
        : one === SPHERE
          ? [a, a, a, 0]
          : one === CAPSULE
            ? [a, a, a, b]
            : one === CYLINDER
              ? [a, a, b, 0]
              : one === MESH
                ? [1, 1, 1, 0]
                : [a, b, c, 0];
    });
    const period = bodies.period && bodies.period.length ? [...bodies.period] : null;
    return {
      names: (bodies.name || "").split("\n"),
      moves: [...bodies.moves],
      body,
      kind,
      scale,
      place,
      turn,
      meshes,
      planar: Boolean(bodies.planar && bodies.planar[0]),
      unit: bodies.unit || "m",
      ...(Object.keys(strain).length ? { strain } : {}),
      ...(period ? { period } : {}),
    };
  };

  // ---- where the contacts are: as the file says, else as a graph
  const given = (bodies, contacts) => {
    const pairs = rows(contacts.body, 2).map(([a, b]) => [b, a]);
    const places = rows(bodies.place, 3);
    const points = rows(contacts.point, 3);
    const limits = [];
    const crossing = [];
    const images = [];
    const period = bodies.period && bodies.period.length ? bodies.period : null;
    // the nearest images of both bodies are meant
    const whole = (x) =>
      x.map((v, i) => (period && i < 2 ? period[i] * Math.round(v / period[i]) : 0));
    const apart = (k, side) => whole(points[k].map((x, i) => x - places[pairs[k][side]][i]));
    rows(contacts.shape, 2).forEach((shapes, k) => {
      if (Math.min(...shapes) < 0) {
        limits.push(k);
        return;
      }
      const ends = [apart(k, 0), apart(k, 1)];
      const shift = ends[1].map((x, i) => x - ends[0][i]);
      points[k] = points[k].map((x, i) => x - ends[0][i]);
      if (shift.some((x) => x)) {
        crossing.push(k);
        images.push(points[k].map((x, i) => x - shift[i]));
      }
    });
    return {
      source: "file",
      note: "",
      bodies: [],
      points,
      pairs,
      normals: rows(contacts.normal, 3),
      ...(limits.length ? { limits } : {}),
      ...(period ? { crossing, images } : {}),
    };
  };
  /* points that W couples are near, by Fruchterman & Reingold (1991) */
  const laidOut = async (fclib, problem) => {
    const nc = problem.mu.length;
    const d = problem.spacedim;
    if (nc > LAID_OUT) return null;
    const local = "W" in problem ? problem : await fclib.condense(problem);
    const { W } = await fclib.with_storage(local, "triplet");
    const edges = new Set();
    for (const [e, x] of W.x.entries()) {
      const a = Math.floor(W.i[e] / d);
      const b = Math.floor(W.p[e] / d);
      if (x && a < b) edges.add(a * nc + b);
    }
    const side = Math.max(1, Math.cbrt(nc));
    const points = [...Array(nc)].map((_, k) =>
      [1, 2, 3].map((i) => side * Math.sin(12.9898 * (k + 1) * i)),
    );
    for (let round = 0; round < ROUNDS; round++) {
      const steps = points.map((x) => {
        const step = x.map((v) => -0.05 * v * side);
        for (const y of points) {
          const away = x.map((v, i) => v - y[i]);
          const far = Math.max(0.01, away[0] ** 2 + away[1] ** 2 + away[2] ** 2);
          away.forEach((v, i) => {
            step[i] += v / far;
          });
        }
        return step;
      });
      for (const key of edges) {
        const [a, b] = [Math.floor(key / nc), key % nc];
        const along = points[b].map((v, i) => v - points[a][i]);
        const size = Math.hypot(...along);
        along.forEach((v, i) => {
          steps[a][i] += v * size;
          steps[b][i] -= v * size;
        });
      }
      steps.forEach((step, k) => {
        const size = Math.max(1e-12, Math.hypot(...step));
        const most = Math.min(size, 0.4 * side * (1 - round / ROUNDS) + 1e-3);
        step.forEach((v, i) => {
          points[k][i] += (v / size) * most;
        });
      });
    }
    return {
      source: "graph",
      note: "as a graph: points that W couples are near",
      bodies: [],
      points,
      pairs: points.map(() => [-1, -1]),
    };
  };

  Fclib.LAID_OUT = LAID_OUT;
  /* what a picture is drawn from, as view.py has it */
  Fclib.viewOf = async (fclib, problem) => {
    const { bodies, contacts, mu } = problem;
    if (!mu.length) return null;
    const network = bodies && contacts ? given(bodies, contacts) : await laidOut(fclib, problem);
    return (
      network && {
        mu: [...mu],
        network,
        patterns: [],
        ...(bodies && contacts ? { solids: solidsOf(bodies, contacts) } : {}),
      }
    );
  };
})();
