#include "merit/merit_1.hpp"

#include <cmath>

#include "contact/laws.hpp"
#include "linalg/factorization.hpp"

namespace fclib {

namespace {

/// ||F||, in the form of 3.1: if r is large, its rounding has the size of r's.
template <class Cone>
double natural_norm(const Friction& friction, const Vector& u, const Vector& r) {
  using Vec = typename Cone::Vec;
  constexpr int d = Vec::RowsAtCompileTime;
  double squares = 0;
  for (Eigen::Index contact = 0; contact < friction.mu.size(); ++contact) {
    const Cone cone(friction, contact);
    const Vec reaction = r.segment<d>(d * contact);
    const Vec velocity = u.segment<d>(d * contact);
    const Vec y = reaction - cone.modified(velocity);
    squares += (reaction - cone.project(y)).squaredNorm();
  }
  return std::sqrt(squares);
}

double natural_term(Index spacedim, const Friction& friction, const Vector& q, const Vector& u,
                    const Vector& r) {
  const double norm = with_cone(spacedim, friction,
                                [&]<class Cone>() { return natural_norm<Cone>(friction, u, r); });
  return norm / (1 + std::sqrt(q.norm()));
}

double relative(const Vector& residual, const Vector& constant) {
  return residual.norm() / (1 + constant.norm());
}

double judge(const LocalProblem& problem, const Friction& friction, const Solution& solution) {
  double bilateral = 0;
  Vector u = problem.q;
  if (is_mixed(problem)) {
    Vector residual = problem.s;
    multiply_transposed_add(problem.V, solution.r, residual);
    multiply_add(problem.R, solution.l, residual);
    bilateral = relative(residual, problem.s);
    multiply_add(problem.V, solution.l, u);
  }
  multiply_add(problem.W, solution.r, u);
  return natural_term(problem.spacedim, friction, problem.q, u, solution.r) + bilateral;
}

double judge(const GlobalProblem& problem, const Friction& friction, const Solution& solution) {
  const Factorization mass(to_eigen(problem.M), "M");
  Vector momentum = problem.f;
  multiply_add(problem.H, solution.r, momentum);
  if (is_mixed(problem)) multiply_add(problem.G, solution.l, momentum);
  const Vector v = solution.v.size() > 0 ? solution.v : Vector(mass.solve(momentum));

  Vector residual = -momentum;
  multiply_add(problem.M, v, residual);
  double others = relative(residual, problem.f);
  if (is_mixed(problem)) {
    Vector bilateral = problem.b;
    multiply_transposed_add(problem.G, v, bilateral);
    others += relative(bilateral, problem.b);
  }

  Vector u = problem.w;
  multiply_transposed_add(problem.H, v, u);
  Vector q = problem.w;
  multiply_transposed_add(problem.H, Vector(mass.solve(problem.f)), q);
  return natural_term(problem.spacedim, friction, q, u, solution.r) + others;
}

}  // namespace

template <class P>
double merit_1(const P& problem, const Solution& solution) {
  validate(problem);
  validate(solution, problem);
  return judge(problem, friction_of(problem), solution);
}

#define FCLIB_INSTANTIATE(P) template double merit_1<P>(const P&, const Solution&);
FCLIB_FOR_EACH_FORMULATION(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
