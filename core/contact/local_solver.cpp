#include "contact/local_solver.hpp"

#include <algorithm>
#include <cmath>

#include "contact/newton_contact.hpp"

namespace fclib {

template <class Cone>
bool project_diagonal(const ContactMatrix<Cone::dim>& a, const Cone& cone,
                      const typename Cone::Vec& b, typename Cone::Vec& r) {
  constexpr int D = Cone::dim;
  typename Cone::Vec next = r;
  typename Cone::Vec u = detail::affine<D>(a, r, b);
  if (!(a(0, 0) > 0)) return false;
  next[0] = std::max(0.0, r[0] - u[0] / a(0, 0));
  const double moved = next[0] - r[0];
  for (int k = 0; k < D; ++k) u[k] += a(k, 0) * moved;
  bool possible = true;
  for_each_group<Cone>([&](auto g) {
    constexpr int at = Cone::start(g);
    constexpr int size = Cone::size(g);
    // the norm of the block: a step of 1 / norm never overshoots
    double norm = 0;
    for (int row = at; row < at + size; ++row) {
      double sum = 0;
      for (int col = at; col < at + size; ++col) sum += std::abs(a(row, col));
      norm = std::max(norm, sum);
    }
    possible = possible && norm > 0;
    if (!possible) return;
    for (int k = at; k < at + size; ++k) next[k] -= u[k] / norm;
    const double radius = cone.coefficient(g) * next[0];
    const double length = part_norm<size>(&next[at]);
    const double shorter = length > radius ? radius / length : 1.0;
    for (int k = at; k < at + size; ++k) next[k] *= shorter;
    for (int row = 0; row < D; ++row) {
      double sum = 0;
      for (int col = at; col < at + size; ++col) sum += a(row, col) * (next[col] - r[col]);
      u[row] += sum;
    }
  });
  if (possible) r = next;
  return possible;
}

template <class Cone>
void LocalStep<Cone>::other(ContactProblem<Cone>& contact, const Vec& b, Vec& next) const {
  const Vec old = next;
  if (!solved(contact, b, next)) contact.projected.solve(b, accuracy, iterations, next);
  if (relaxation != 1) {
    Vec between;
    for (int k = 0; k < Cone::dim; ++k) {
      between[k] = relaxation * next[k] + (1.0 - relaxation) * old[k];
    }
    next = contact.projected.cone().project(between);
  }
}

template <class Cone>
bool LocalStep<Cone>::solved(ContactProblem<Cone>& contact, const Vec& b, Vec& next) const {
  const auto& block = contact.projected.block();
  const Cone& cone = contact.projected.cone();
  switch (solver) {
    case LocalSolver::exact:
      return contact.solve_exact(b, next);
    case LocalSolver::projection:
      return false;
    case LocalSolver::diagonal:
      return project_diagonal(block, cone, b, next);
    case LocalSolver::fischer_burmeister:
      if constexpr (Cone::groups == 1) {
        return newton_fischer_burmeister(block, cone, b, accuracy, iterations, next);
      }
      [[fallthrough]];
    case LocalSolver::alart_curnier:
      return newton_alart_curnier(block, cone, b, accuracy, iterations, next);
    case LocalSolver::hybrid:
      return newton_alart_curnier(block, cone, b, accuracy, iterations, next) ||
             contact.solve_exact(b, next);
  }
  return false;
}

#define FCLIB_INSTANTIATE(Cone)                                                      \
  template bool project_diagonal<Cone>(const ContactMatrix<Cone::dim>&, const Cone&, \
                                       const Cone::Vec&, Cone::Vec&);                \
  template struct LocalStep<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
