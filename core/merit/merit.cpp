#include "merit/merit.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "cones/coulomb.hpp"
#include "linalg/factorization.hpp"

namespace fclib {

namespace {

double relative(double residual, std::initializer_list<double> terms) {
  const double largest = std::max(terms);
  return largest > 0 ? residual / largest : residual;
}

/// The parts that depend on one contact at a time. `scale` is tr(W_aa) / d of each contact.
template <int D>
void judge_contacts(const Vector& mu, const Vector& q, const Vector& u, const Vector& r,
                    const Vector& scale, Merit& result) {
  double squares = 0;
  double scaled_squares = 0;
  double scaled_q = 0;
  for (Eigen::Index contact = 0; contact < mu.size(); ++contact) {
    const ContactVector<D> ua = u.segment<D>(D * contact);
    const ContactVector<D> ra = r.segment<D>(D * contact);
    const ContactVector<D> modified = modified_velocity<D>(ua, mu[contact]);
    squares += natural_map<D>(ua, ra, mu[contact]).squaredNorm();
    const double rho = scale[contact] > 0 ? 1.0 / scale[contact] : 1.0;
    scaled_squares += natural_map<D>(ua, ra, mu[contact], rho).squaredNorm();
    scaled_q += rho * rho * q.segment<D>(D * contact).squaredNorm();
    result.cone = std::max(result.cone, cone_violation<D>(ra, mu[contact]));
    result.dual_cone = std::max(result.dual_cone, dual_violation<D>(modified, mu[contact]));
    result.complementarity = std::max(result.complementarity, std::abs(ra.dot(modified)));

    // the status is read off the set that the natural map projects on
    const ContactVector<D> y = ra - rho * modified;
    const double norm = tangential_norm<D>(y);
    if (norm <= mu[contact] * y[0] && y[0] > 0) {
      ++result.stick;
    } else if (mu[contact] * norm <= -y[0]) {
      ++result.open;
    } else {
      ++result.slide;
    }
  }
  const double norm_q = q.norm();
  result.natural = std::sqrt(squares) / (norm_q > 0 ? norm_q : 1.0);
  result.scaled_natural = std::sqrt(scaled_squares) / (scaled_q > 0 ? std::sqrt(scaled_q) : 1.0);
}

void judge_contacts(int spacedim, const Vector& mu, const Vector& q, const Vector& u,
                    const Vector& r, const Vector& scale, Merit& result) {
  if (spacedim == 2) {
    judge_contacts<2>(mu, q, u, r, scale, result);
  } else {
    judge_contacts<3>(mu, q, u, r, scale, result);
  }
  result.error = std::max({result.natural, result.dynamics, result.bilateral, result.kinematics});
}

/// std::max drops a NaN; a solution that holds one must never look good.
template <class P>
void require_valid(const P& problem, const Solution& solution) {
  validate(problem);
  validate(solution, problem);
}

}  // namespace

Merit merit(const LocalProblem& problem, const Solution& solution) {
  require_valid(problem, solution);
  Merit result;

  // u = W r + V lambda + q
  Vector from_r = Vector::Zero(problem.q.size());
  multiply_add(problem.W, solution.r, from_r);
  Vector from_l = Vector::Zero(problem.q.size());
  if (is_mixed(problem)) {
    multiply_add(problem.V, solution.l, from_l);
    Vector vr = Vector::Zero(problem.s.size());
    multiply_transposed_add(problem.V, solution.r, vr);
    Vector rl = Vector::Zero(problem.s.size());
    multiply_add(problem.R, solution.l, rl);
    result.bilateral =
        relative((vr + rl + problem.s).norm(),
                 {term_size_transposed(problem.V, solution.r), rl.norm(), problem.s.norm()});
  }
  const Vector u = from_r + from_l + problem.q;
  if (solution.u.size() > 0) {
    result.kinematics = relative((solution.u - u).norm(), {solution.u.norm(), from_r.norm(),
                                                           from_l.norm(), problem.q.norm()});
  }

  Vector scale = Vector::Zero(problem.mu.size());
  for_each_entry(problem.W, [&](Index row, Index col, double value) {
    if (row == col) scale[row / problem.spacedim] += value / problem.spacedim;
  });
  judge_contacts(problem.spacedim, problem.mu, problem.q, u, solution.r, scale, result);
  return result;
}

Merit merit(const GlobalProblem& problem, const Solution& solution) {
  require_valid(problem, solution);
  Merit result;
  const Factorization mass(to_eigen(problem.M), "M");

  // M v = H r + G lambda + f
  Vector hr = Vector::Zero(problem.f.size());
  multiply_add(problem.H, solution.r, hr);
  Vector gl = Vector::Zero(problem.f.size());
  if (is_mixed(problem)) multiply_add(problem.G, solution.l, gl);
  Vector v = solution.v;
  if (v.size() == 0) {
    v = mass.solve(hr + gl + problem.f);
  } else {
    Vector mv = Vector::Zero(problem.f.size());
    multiply_add(problem.M, v, mv);
    result.dynamics = relative((mv - hr - gl - problem.f).norm(),
                               {mv.norm(), hr.norm(), gl.norm(), problem.f.norm()});
  }
  if (is_mixed(problem)) {
    Vector gv = Vector::Zero(problem.b.size());
    multiply_transposed_add(problem.G, v, gv);
    // G^T v vanishes where b does, so that its own norm would compare rounding with rounding
    result.bilateral =
        relative((gv + problem.b).norm(), {term_size_transposed(problem.G, v), problem.b.norm()});
  }

  // u = H^T v + w
  Vector hv = Vector::Zero(problem.w.size());
  multiply_transposed_add(problem.H, v, hv);
  const Vector u = hv + problem.w;
  if (solution.u.size() > 0) {
    result.kinematics =
        relative((solution.u - u).norm(), {solution.u.norm(), hv.norm(), problem.w.norm()});
  }

  Vector q = problem.w;
  multiply_transposed_add(problem.H, mass.solve(problem.f), q);
  Vector scale = Vector::Zero(problem.mu.size());
  const SparseColumns h = to_eigen(problem.H);
  const SparseColumns y = mass.is_cholesky() ? mass.half_solve(h) : mass.solve(h);
  for (Eigen::Index col = 0; col < y.cols(); ++col) {
    const double diagonal =
        mass.is_cholesky() ? y.col(col).squaredNorm() : h.col(col).dot(y.col(col));
    scale[col / problem.spacedim] += diagonal / problem.spacedim;
  }
  judge_contacts(problem.spacedim, problem.mu, q, u, solution.r, scale, result);
  return result;
}

}  // namespace fclib
