// The merits once more, as their formulas stand, with dense matrices in double precision.
#pragma once

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "merit/merit.hpp"
#include "random_problems.hpp"

namespace fclib::testing {

/// || |A| |x| ||
inline double sum_of_sizes(const Eigen::MatrixXd& a, const Vector& x) {
  return (a.cwiseAbs() * x.cwiseAbs()).norm();
}

inline double over_largest(const Vector& residual, std::initializer_list<double> terms) {
  return residual.norm() / std::max(terms);
}

/// u^ of a contact, by groups of components with one coefficient each.
template <class Cone>
typename Cone::Vec modified_velocity(const Cone& cone, const typename Cone::Vec& u) {
  typename Cone::Vec result = u;
  for (int group = 0; group < Cone::groups; ++group) {
    double squares = 0;
    for (int k = 0; k < Cone::group_size; ++k) {
      squares += std::pow(u[1 + group * Cone::group_size + k], 2);
    }
    result[0] += cone.coefficient(group) * std::sqrt(squares);
  }
  return result;
}

/// What there is to judge: the recomputed u, q, and tr(W_aa) / d of each contact.
struct Reduced {
  Vector u;
  Vector q;
  Vector scale;
};

/// Dynamics, bilateral and kinematics; the rest follows from `Reduced`.
template <class P>
Merit equations(const P& problem, const Solution& given, Reduced& reduced) {
  Merit result;
  const bool mixed = is_mixed(problem);
  const Vector l = mixed ? given.l : Vector::Zero(1);
  Eigen::MatrixXd w;
  double largest_of_u = 0;
  if constexpr (requires { problem.W; }) {
    w = dense(problem.W);
    const Eigen::Index m = w.rows();
    const Eigen::MatrixXd v = mixed ? dense(problem.V) : Eigen::MatrixXd::Zero(m, 1);
    reduced.q = problem.q;
    reduced.u = w * given.r + v * l + problem.q;
    largest_of_u = std::max({sum_of_sizes(w, given.r), sum_of_sizes(v, l), problem.q.norm()});
    if (mixed) {
      const Eigen::MatrixXd r = dense(problem.R);
      result.bilateral = over_largest(
          v.transpose() * given.r + r * l + problem.s,
          {sum_of_sizes(v.transpose(), given.r), sum_of_sizes(r, l), problem.s.norm()});
    }
  } else {
    const Eigen::MatrixXd mass = dense(problem.M);
    const Eigen::MatrixXd h = dense(problem.H);
    const Eigen::Index n = mass.rows();
    const Eigen::MatrixXd g = mixed ? dense(problem.G) : Eigen::MatrixXd::Zero(n, 1);
    const Eigen::MatrixXd inverse = mass.inverse();
    const Vector momentum = h * given.r + g * l + problem.f;
    const Vector v = given.v.size() > 0 ? given.v : Vector(inverse * momentum);
    if (given.v.size() > 0) {
      result.dynamics = over_largest(
          mass * v - momentum,
          {sum_of_sizes(mass, v), sum_of_sizes(h, given.r), sum_of_sizes(g, l), problem.f.norm()});
    }
    const Vector free = inverse * problem.f;
    if (mixed) {
      result.bilateral = over_largest(
          g.transpose() * v + problem.b,
          {sum_of_sizes(g.transpose(), v), sum_of_sizes(g.transpose(), free), problem.b.norm()});
    }
    w = h.transpose() * inverse * h;
    reduced.q = h.transpose() * free + problem.w;
    reduced.u = h.transpose() * v + problem.w;
    largest_of_u = std::max(sum_of_sizes(h.transpose(), v), problem.w.norm());
  }
  if (given.u.size() > 0) {
    result.kinematics = over_largest(given.u - reduced.u, {given.u.norm(), largest_of_u});
  }
  const Index d = problem.spacedim;
  reduced.scale.resize(problem.mu.size());
  for (Eigen::Index a = 0; a < reduced.scale.size(); ++a) {
    reduced.scale[a] = w.block(d * a, d * a, d, d).trace() / d;
  }
  return result;
}

/// ||r - P_K(r - rho u^)|| of a contact.
template <class Cone>
double natural_norm(const Cone& cone, const typename Cone::Vec& u, const typename Cone::Vec& r,
                    double rho) {
  const typename Cone::Vec y = r - rho * modified_velocity(cone, u);
  return (r - cone.project(y)).norm();
}

/// Every figure of a merit, and those of each contact.
template <class Cone, class P>
Merit by_definition(const P& problem, const Solution& given, ContactMerits& each) {
  using Vec = typename Cone::Vec;
  constexpr int d = Cone::dim;
  Reduced reduced;
  Merit result = equations(problem, given, reduced);
  const Eigen::Index nc = problem.mu.size();
  each = {.status = {},
          .u = reduced.u,
          .natural = Vector(nc),
          .cone = Vector(nc),
          .dual_cone = Vector(nc)};
  double squares = 0;
  double scaled_squares = 0;
  double scaled_q = 0;
  for (Eigen::Index a = 0; a < nc; ++a) {
    const Cone cone(friction_of(problem), a);
    const Vec u = reduced.u.segment<d>(d * a);
    const Vec r = given.r.segment<d>(d * a);
    const Vec hat = modified_velocity(cone, u);
    const double rho = 1 / reduced.scale[a];
    each.natural[a] = natural_norm(cone, u, r, 1);
    each.cone[a] = (r - cone.project(r)).norm();
    // y is in K* where -y is in the polar cone: what is outside is the projection of -y on K
    each.dual_cone[a] = cone.project(-hat).norm();
    squares += std::pow(each.natural[a], 2);
    scaled_squares += std::pow(natural_norm(cone, u, r, rho), 2);
    scaled_q += (rho * reduced.q.segment<d>(d * a)).squaredNorm();
    result.complementarity = std::max(result.complementarity, std::abs(r.dot(hat)));
    const Vec y = r - rho * hat;
    const Vec projection = cone.project(y);
    const bool open = projection.isZero(0);
    const bool stick = !open && projection == y;
    each.status.push_back(open    ? ContactStatus::open
                          : stick ? ContactStatus::stick
                                  : ContactStatus::slide);
    result.open += open ? 1 : 0;
    result.stick += stick ? 1 : 0;
    result.slide += open || stick ? 0 : 1;
  }
  result.natural = std::sqrt(squares) / reduced.q.norm();
  result.scaled_natural = std::sqrt(scaled_squares / scaled_q);
  result.cone = each.cone.maxCoeff();
  result.dual_cone = each.dual_cone.maxCoeff();
  result.error = std::max({result.natural, result.dynamics, result.bilateral, result.kinematics});
  return result;
}

}  // namespace fclib::testing
