#include "stepping/step.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <tuple>
#include <utility>

namespace fclib::stepping {

namespace {

using Doubles = std::vector<double>;
using Indices = std::vector<Index>;

std::size_t at(Index k) { return static_cast<std::size_t>(k); }

/// 0, ..., count - 1
Indices all_of(Index count) {
  Indices numbers(at(count));
  std::iota(numbers.begin(), numbers.end(), 0);
  return numbers;
}

/// Those of 0, ..., count - 1 that are marked, or those that are not.
Indices marked(const std::vector<bool>& marks, bool which) {
  Indices found;
  for (std::size_t k = 0; k < marks.size(); ++k) {
    if (marks[k] == which) found.push_back(static_cast<Index>(k));
  }
  return found;
}

/// The place of each of `count` numbers among some; -1 for the others.
Indices places_of(const Indices& numbers, Index count) {
  Indices place(at(count), -1);
  for (std::size_t k = 0; k < numbers.size(); ++k) place[at(numbers[k])] = static_cast<Index>(k);
  return place;
}

template <class Number>
std::vector<Number> taken(const std::vector<Number>& values, const Indices& which) {
  std::vector<Number> found;
  found.reserve(which.size());
  for (const Index k : which) found.push_back(values[at(k)]);
  return found;
}

/// The columns of H of some contacts.
Indices columns_of(const Indices& contacts, Index d) {
  Indices columns;
  columns.reserve(contacts.size() * at(d));
  for (const Index c : contacts) {
    for (Index k = 0; k < d; ++k) columns.push_back(c * d + k);
  }
  return columns;
}

/// All of the step before a part of it is left out.
struct Whole {
  Matrix M, H, G;
  Doubles f, w, b;
  std::vector<std::int64_t> tree;
};

Whole dynamics(const System& system) {
  const Index n = system.M.rows;
  const double implicit = system.theta * system.h;
  Whole made;
  const Matrix damped = sum(system.M, implicit, system.C);
  made.f.assign(at(n), 0.0);
  add_product(stepping::columns_of(damped), system.v, made.f);
  for (std::size_t i = 0; i < made.f.size(); ++i) made.f[i] += system.h * system.force[i];
  if (system.theta < 1) {
    Doubles pulled(at(n), 0.0);
    add_product(system.K, system.v, pulled);
    const double factor = implicit * (system.h - implicit);
    for (std::size_t i = 0; i < made.f.size(); ++i) made.f[i] -= factor * pulled[i];
  }
  made.M = sum(stepping::columns_of(damped), implicit * implicit, system.K);
  const Index nc = system.H.cols / system.d;
  Indices contacts;
  if (system.active) {
    contacts.assign(system.active->begin(), system.active->end());
  } else {
    contacts = all_of(nc);
  }
  made.H = part(system.H, columns_of(contacts, system.d));
  made.w.assign(contacts.size() * at(system.d), 0.0);
  for (std::size_t c = 0; c < contacts.size(); ++c) made.w[c * at(system.d)] = system.w[c];
  made.G = part(system.G, all_of(system.G.cols));
  made.b.assign(system.b.begin(), system.b.end());
  made.tree.assign(system.tree.begin(), system.tree.end());
  return made;
}

/// An auxiliary degree of freedom and a contact for each joint: its normal velocity is the
/// auxiliary one, and its first tangential one the joint's.
void add_dry_friction(Whole& made, const DryFriction& dry, double h, int d) {
  const auto count = static_cast<Index>(dry.bound.size());
  const Index n = made.M.rows;
  for (Matrix* const matrix : {&made.M, &made.H, &made.G}) matrix->rows += count;
  made.M.cols += count;
  made.H.cols += count * d;
  const auto entry = [](Matrix& matrix, Index row, double value) {
    matrix.i.push_back(row);
    matrix.x.push_back(value);
  };
  const auto close = [](Matrix& matrix) {
    matrix.p.push_back(static_cast<Index>(matrix.i.size()));
  };
  for (Index k = 0; k < count; ++k) {
    entry(made.M, n + k, dry.mass[at(k)]);
    close(made.M);
    entry(made.H, n + k, 1.0);
    close(made.H);
    for (Index e = dry.gradient.start(k); e < dry.gradient.start(k + 1); ++e) {
      entry(made.H, dry.gradient.i[e], dry.gradient.x[e]);
    }
    for (int other = 1; other < d; ++other) close(made.H);
    made.f.push_back(-h * dry.bound[at(k)]);
    made.tree.push_back(made.tree[at(dry.gradient.i[dry.gradient.start(k)])]);
  }
  made.w.resize(made.w.size() + at(count * d), 0.0);
}

/// The given velocities go to the right sides, and leave the unknowns: the numbers of the others.
Indices take_driven(Whole& made, const Driven& driven) {
  const Index n = made.M.rows;
  Doubles moved(at(n), 0.0);
  std::vector<bool> given(at(n), false);
  for (std::size_t k = 0; k < driven.dof.size(); ++k) {
    const auto dof = static_cast<std::size_t>(driven.dof[k]);
    moved[dof] = driven.velocity[k];
    given[dof] = true;
  }
  Doubles pulled(at(n), 0.0);
  add_product(stepping::columns_of(made.M), moved, pulled);
  for (std::size_t i = 0; i < made.f.size(); ++i) made.f[i] -= pulled[i];
  const auto add = [&](const Matrix& matrix, Doubles& side) {
    for (Index col = 0; col < matrix.cols; ++col) {
      side[at(col)] += product(stepping::columns_of(matrix), col, moved);
    }
  };
  add(made.H, made.w);
  add(made.G, made.b);
  Indices kept = marked(given, false);
  const Indices place = places_of(kept, n);
  const auto count = static_cast<Index>(kept.size());
  made.M = part(stepping::columns_of(made.M), kept, place, count);
  made.H = part(stepping::columns_of(made.H), all_of(made.H.cols), place, count);
  made.G = part(stepping::columns_of(made.G), all_of(made.G.cols), place, count);
  made.f = taken(made.f, kept);
  made.tree = taken(made.tree, kept);
  return kept;
}

/// Contacts that move nothing are none: those that remain, if that is not all of them.
std::optional<std::vector<std::int64_t>> take_touching(Whole& made, Index d) {
  Indices contacts;
  const Index nc = made.H.cols / d;
  for (Index c = 0; c < nc; ++c) {
    if (made.H.p[at((c + 1) * d)] > made.H.p[at(c * d)]) contacts.push_back(c);
  }
  if (contacts.size() == at(nc)) return std::nullopt;
  const Indices columns = columns_of(contacts, d);
  made.H = part(stepping::columns_of(made.H), columns);
  made.w = taken(made.w, columns);
  return std::vector<std::int64_t>(contacts.begin(), contacts.end());
}

/// Which degrees of freedom are linked to a contact, and which bilateral rows are among them.
///
/// Trees of bodies are kept whole, whatever part of them a contact moves. Without a contact,
/// everything is kept: such a problem says that nothing touches.
std::pair<std::vector<bool>, std::vector<bool>> linked(const Whole& made) {
  const Index n = made.M.rows, p = made.G.cols;
  std::vector<bool> inside(at(n), true), reached(at(p), true);
  if (made.H.cols == 0) return {inside, reached};
  const auto tree = [&](Index row) { return static_cast<std::size_t>(made.tree[at(row)]); };
  const auto largest = std::max_element(made.tree.begin(), made.tree.end());
  std::vector<bool> touched(largest == made.tree.end() ? 0
                                                       : static_cast<std::size_t>(*largest + 1));
  for (const Index row : made.H.i) touched[tree(row)] = true;
  reached.assign(at(p), false);
  // inertia and bilateral rows pass the mark on
  bool changes = std::find(touched.begin(), touched.end(), false) != touched.end() || p > 0;
  while (changes) {
    changes = false;
    for (Index col = 0; col < n; ++col) {
      for (Index k = made.M.p[at(col)]; k < made.M.p[at(col + 1)]; ++k) {
        const std::size_t one = tree(made.M.i[at(k)]), other = tree(col);
        if (touched[one] == touched[other]) continue;
        touched[one] = touched[other] = changes = true;
      }
    }
    for (Index col = 0; col < p; ++col) {
      bool any = false, all = true;
      for (Index k = made.G.p[at(col)]; k < made.G.p[at(col + 1)]; ++k) {
        const bool mark = touched[tree(made.G.i[at(k)])];
        any = any || mark;
        all = all && mark;
      }
      if (!any) continue;
      reached[at(col)] = true;
      if (all) continue;
      changes = true;
      for (Index k = made.G.p[at(col)]; k < made.G.p[at(col + 1)]; ++k) {
        touched[tree(made.G.i[at(k)])] = true;
      }
    }
  }
  for (Index i = 0; i < n; ++i) inside[at(i)] = touched[tree(i)];
  return {inside, reached};
}

}  // namespace

Step step_of(const System& system) {
  const Index d = system.d, size = system.M.rows;
  Whole made = dynamics(system);
  if (system.dry) add_dry_friction(made, *system.dry, system.h, system.d);
  Indices number;  // of the system, of each degree of freedom
  Step step;
  if (system.driven) {
    number = take_driven(made, *system.driven);
    step.touching = take_touching(made, d);
  } else {
    number = all_of(made.M.rows);
  }
  const auto dofs_of = [&](const Indices& which) {
    std::vector<std::int64_t> dofs;
    for (const Index k : which) {
      if (number[at(k)] < size) dofs.push_back(number[at(k)]);
    }
    return dofs;
  };

  std::vector<bool> inside, reached;
  bool whole = system.all_bodies;
  if (!whole) {
    std::tie(inside, reached) = linked(made);
    whole = std::find(inside.begin(), inside.end(), false) == inside.end() &&
            std::find(reached.begin(), reached.end(), false) == reached.end();
  }
  if (whole) {
    if (system.driven) step.problem.dofs = dofs_of(all_of(made.M.rows));
    step.problem.M = std::move(made.M);
    step.problem.H = std::move(made.H);
    step.problem.G = std::move(made.G);
    step.problem.f = std::move(made.f);
    step.problem.w = std::move(made.w);
    step.problem.b = std::move(made.b);
    return step;
  }
  // nothing couples the bodies inside the problem to those outside
  for (const bool which : {true, false}) {
    const Indices bodies = marked(inside, which), rows = marked(reached, which);
    if (bodies.empty()) continue;
    Equations& part_of = which ? step.problem : step.rest.emplace();
    const Indices place = places_of(bodies, made.M.rows);
    const auto count = static_cast<Index>(bodies.size());
    part_of.M = part(stepping::columns_of(made.M), bodies, place, count);
    part_of.G = part(stepping::columns_of(made.G), rows, place, count);
    if (which) {
      part_of.H = part(stepping::columns_of(made.H), all_of(made.H.cols), place, count);
      part_of.w = made.w;
    }
    part_of.f = taken(made.f, bodies);
    part_of.b = taken(made.b, rows);
    part_of.dofs = dofs_of(bodies);
  }
  return step;
}

}  // namespace fclib::stepping
