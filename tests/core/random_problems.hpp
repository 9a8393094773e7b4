// Random problems and solutions of every formulation, for tests of what is done to them. A contact
// has d components, n velocities, p bilateral constraints; nothing is solved.
#pragma once

#include "problem.hpp"
#include "random_data.hpp"

namespace fclib::testing {

/// Positive definite; not symmetric where `skew` is not 0, as iteration matrices in files.
inline Matrix random_definite(RandomData& random, Eigen::Index size, double share, double skew) {
  const SparseColumns a = random.definite(size, share);
  return Matrix::from_eigen(skew == 0 ? a
                                      : SparseColumns(a + skew * random.sparse(size, size, share)));
}

/// Coefficients from 0.1 to 1.
inline Vector random_friction(RandomData& random, Eigen::Index nc) {
  return Vector::Constant(nc, 0.55) + 0.45 * random.vector(nc);
}

template <class P>
P random_local(RandomData& random, Index d, Eigen::Index nc, Eigen::Index p, double skew = 0) {
  P problem;
  problem.spacedim = d;
  problem.W = random_definite(random, d * nc, 0.5, skew);
  problem.q = random.vector(d * nc);
  problem.mu = random_friction(random, nc);
  if constexpr (P::rolling) problem.mu_r = random_friction(random, nc);
  if (p > 0) {
    problem.V = Matrix::from_eigen(random.sparse(d * nc, p, 0.8));
    problem.R = random_definite(random, p, 0.8, skew);
    problem.s = random.vector(p);
  }
  validate(problem);
  return problem;
}

template <class P>
P random_global(RandomData& random, Eigen::Index n, Index d, Eigen::Index nc, Eigen::Index p,
                double skew = 0) {
  P problem;
  problem.spacedim = d;
  problem.M = random_definite(random, n, 0.2, skew);
  problem.H = Matrix::from_eigen(random.sparse(n, d * nc, 0.5));
  problem.f = random.vector(n);
  problem.w = random.vector(d * nc);
  problem.mu = random_friction(random, nc);
  if constexpr (P::rolling) problem.mu_r = random_friction(random, nc);
  if (p > 0) {
    problem.G = Matrix::from_eigen(random.sparse(n, p, 0.8));
    problem.b = random.vector(p);
  }
  validate(problem);
  return problem;
}

/// Random numbers for r and lambda; u and v where they are asked for.
template <class P>
Solution random_solution(RandomData& random, const P& problem, bool with_u, bool with_v) {
  Solution solution;
  solution.r = random.vector(problem.size(Dim::m));
  if (with_u) solution.u = random.vector(problem.size(Dim::m));
  if (with_v) solution.v = random.vector(problem.size(Dim::n));
  solution.l = random.vector(problem.size(Dim::p));
  return solution;
}

inline Eigen::MatrixXd dense(const Matrix& a) { return Eigen::MatrixXd(to_eigen(a)); }

}  // namespace fclib::testing
