// the sums that depend on what a person chooses: fclib.bench.profiles has the same, and a test compares them
"use strict";
(() => {
  /* instances that all of the chosen solvers have run, of the chosen problems; costs null where a solver failed */
  Fclib.compared = (bench, costs, solvers, keep) => {
    const chosen = [];
    bench.problems.forEach((problem, i) => {
      if (keep(problem) && solvers.every((s) => bench.statuses[s][i] !== ".")) chosen.push(i);
    });
    return { instances: chosen, values: solvers.map((s) => chosen.map((i) => costs[s][i])) };
  };
  /* r_ps = t_ps / min_s t_ps (Dolan & Moré 2002); null where s fails */
  Fclib.ratios = (values) => {
    const count = values.length ? values[0].length : 0, best = new Array(count).fill(Infinity);
    for (const own of values) for (let i = 0; i < count; i++) if (own[i] !== null && own[i] < best[i]) best[i] = own[i];
    return values.map((own) => own.map((t, i) => t === null ? null : t / best[i]));
  };
  /* the share of all instances within each value: steps {x, y} */
  Fclib.shares = (values, from) => {
    const sorted = Float64Array.from(values.filter((v) => v !== null)).sort(), x = [from], y = [0], total = values.length || 1;
    sorted.forEach((v, k) => {
      if (v <= x[x.length - 1]) y[y.length - 1] = (k + 1) / total;
      else { x.push(v); y.push((k + 1) / total); }
    });
    return { x, y };
  };
  /* the value at x of steps: that of the last of them at or before x */
  Fclib.at = (steps, x) => {
    let low = 0, high = steps.x.length;
    while (low < high) { const mid = (low + high) >> 1; if (steps.x[mid] <= x) low = mid + 1; else high = mid; }
    return low ? steps.y[low - 1] : null;
  };
})();
