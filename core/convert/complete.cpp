#include "convert/complete.hpp"

#include "linalg/factorization.hpp"

namespace fclib {

Solution complete(const LocalProblem& problem, Solution solution) {
  validate(solution, problem);
  if (solution.u.size() == 0) {
    solution.u = problem.q;
    multiply_add(problem.W, solution.r, solution.u);
    if (is_mixed(problem)) multiply_add(problem.V, solution.l, solution.u);
  }
  return solution;
}

Solution complete(const GlobalProblem& problem, Solution solution) {
  validate(solution, problem);
  if (solution.v.size() == 0) {
    Vector momentum = problem.f;
    multiply_add(problem.H, solution.r, momentum);
    if (is_mixed(problem)) multiply_add(problem.G, solution.l, momentum);
    solution.v = Factorization(to_eigen(problem.M), "M").solve(momentum);
  }
  if (solution.u.size() == 0) {
    solution.u = problem.w;
    multiply_transposed_add(problem.H, solution.v, solution.u);
  }
  return solution;
}

}  // namespace fclib
