// The sums that follow what a person chooses: which solvers, which problems, what weighs the same.
// What an instance is and what is solved, Python has said: a stored status and cost is of a cell,
// one solver on one instance. The functions are those of fclib/bench/comparison.py and profiles.py
// by the same names, and tests/python/test_report_numbers.py compares them on every choice.
"use strict";
(() => {
  /* what a solver has on an instance: its cost, Infinity if it failed, NaN if there is no
     cell */
  const cell = (bench, costs, s, i) =>
    bench.absent.includes(bench.statuses[s][i]) ? NaN : (costs[s][i] ?? Infinity);
  const isThere = (value) => !Number.isNaN(value);

  /* the instances that are compared, and the values (solvers, instances)
     keep(problem): whether a problem is asked for; own: each solver on what it has run and takes */
  Fclib.compared = (bench, costs, solvers, keep, own = false) => {
    const instances = bench.problems
      .map((_, i) => i)
      .filter((i) => {
        if (!keep(bench.problems[i])) return false;
        const there = solvers.map((s) => isThere(cell(bench, costs, s, i)));
        return own ? there.some(Boolean) : there.every(Boolean);
      });
    return {
      instances,
      values: solvers.map((s) => instances.map((i) => cell(bench, costs, s, i))),
    };
  };

  /* the solvers whose common set has at least the share `common` of what they have run */
  Fclib.widest = (bench, costs, names, keep, common) => {
    const every = Fclib.compared(
      bench,
      costs,
      names.map((_, s) => s),
      keep,
      true,
    ).values;
    const count = every.map((own) => own.filter(isThere).length);
    const order = names.map((_, s) => s).filter((s) => count[s]);
    order.sort((a, b) => count[b] - count[a] || (names[a] < names[b] ? -1 : 1));
    const isWide = (chosen) => {
      const all = Fclib.compared(bench, costs, chosen, keep).instances.length;
      return all >= common * Fclib.compared(bench, costs, chosen, keep, true).instances.length;
    };
    while (order.length > 2 && !isWide(order)) order.pop();
    return order.sort((a, b) => a - b);
  };

  /* what each instance weighs for each solver (solvers, instances); the sum of each solver is 1 */
  Fclib.weights = (values, families, weigh) =>
    values.map((own) => {
      const sizes = new Map();
      own.forEach((value, i) => {
        if (isThere(value)) sizes.set(families[i], (sizes.get(families[i]) || 0) + 1);
      });
      const total =
        weigh === "families" ? sizes.size : [...sizes.values()].reduce((a, b) => a + b, 0);
      return own.map((value, i) =>
        !isThere(value) ? 0 : 1 / (weigh === "families" ? sizes.get(families[i]) * total : total),
      );
    });

  /* r_ps = t_ps / min_s t_ps (Dolan & Moré 2002) */
  Fclib.ratios = (values) => {
    const best = (values[0] || []).map((_, i) =>
      Math.min(...values.map((own) => own[i]).filter(isThere)),
    );
    return values.map((own) =>
      own.map((value, i) => (Number.isFinite(value) ? value / best[i] : value)),
    );
  };

  /* the weight of the instances within each value: steps {x, y} from `from` on */
  Fclib.shares = (values, weights, from) => {
    const order = values
      .map((_, i) => i)
      .filter((i) => Number.isFinite(values[i]))
      .sort((a, b) => values[a] - values[b]);
    const x = [from];
    const y = [0];
    let sum = 0;
    for (const i of order) {
      sum += weights[i];
      if (values[i] > x[x.length - 1]) {
        x.push(values[i]);
        y.push(sum);
      } else y[y.length - 1] = sum;
    }
    return { x, y };
  };

  /* how many instances a solver solves, of how many */
  Fclib.counts = (values) => ({
    solved: values.filter(Number.isFinite).length,
    of: values.filter(isThere).length,
  });
  /* a solver with what it solves: "apgd 170 of 194" */
  Fclib.legend = (name, values) => {
    const { solved, of } = Fclib.counts(values);
    return `${name} ${solved} of ${of}`;
  };

  /* what a profile is of: kind "performance", "data" or "contact" (cost over contacts; without any,
     no instance) -> {instances, values: costs, shown: what is drawn, weights} */
  Fclib.profile = (bench, costs, { solvers, keep, own, weigh, kind, families, contacts }) => {
    const found = Fclib.compared(bench, costs, solvers, keep, own);
    const sizes = found.instances.map((i) => contacts(bench.problems[i]));
    const kept = found.instances.map((_, k) => k).filter((k) => kind !== "contact" || sizes[k]);
    const instances = kept.map((k) => found.instances[k]);
    const values = found.values.map((mine) => kept.map((k) => mine[k]));
    const weights = Fclib.weights(
      values,
      instances.map((i) => families(bench.problems[i])),
      weigh,
    );
    const shown =
      kind === "performance"
        ? Fclib.ratios(values)
        : kind === "contact"
          ? values.map((mine) => mine.map((v, k) => v / sizes[kept[k]]))
          : values;
    return { instances, values, shown, weights };
  };

  /* exp(mean(log(t + s))) - s; a failure counts as its charge */
  Fclib.mean = (values, weights, charges, shift) => {
    let sum = 0;
    values.forEach((value, i) => {
      if (isThere(value))
        sum += weights[i] * Math.log1p((Number.isFinite(value) ? value : charges[i]) / shift);
    });
    return Math.expm1(sum) * shift;
  };

  /* how many runs of a solver ended in which status, by its code */
  Fclib.ended = (bench, s, keep) => {
    const counts = {};
    bench.problems.forEach((problem, i) => {
      const code = bench.statuses[s][i];
      if (code !== "." && keep(problem)) counts[code] = (counts[code] || 0) + 1;
    });
    return counts;
  };

  /* Wilson's 95 % interval of the chance to solve one more */
  Fclib.odds = (solved, of) => {
    const z = 1.96;
    const share = solved / of;
    const middle = (share + (z * z) / (2 * of)) / (1 + (z * z) / of);
    const half =
      (z * Math.sqrt((share * (1 - share)) / of + (z * z) / (4 * of * of))) / (1 + (z * z) / of);
    return [Math.max(0, middle - half), Math.min(1, middle + half)];
  };
})();
