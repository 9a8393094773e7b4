// The merits once more, as their formulas stand, with dense matrices in double precision.
#pragma once

#include <algorithm>
#include <cmath>

#include "merit/merit.hpp"
#include "random_problems.hpp"

namespace fclib::testing {

/// |A| |x|
inline Vector sizes(const Eigen::MatrixXd& a, const Vector& x) {
  return a.cwiseAbs() * x.cwiseAbs();
}

/// The largest quotient of a residual and the velocity of its component.
inline double worst(const Vector& residual, const Vector& velocity) {
  return residual.cwiseQuotient(velocity).cwiseAbs().maxCoeff();
}

/// The norm of each contact's part of x, at each of its components.
inline Vector by_contact(const Vector& x, Index d) {
  Vector result(x.size());
  for (Eigen::Index k = 0; k < x.size(); k += d) {
    result.segment(k, d).setConstant(x.segment(k, d).norm());
  }
  return result;
}

inline Vector at_least(const Vector& x, const Vector& mean_of) {
  return x.cwiseAbs().cwiseMax(mean_of.norm() / std::sqrt(static_cast<double>(mean_of.size())));
}

/// u^ of a contact, by groups of components with one coefficient each.
template <class Cone>
typename Cone::Vec modified_velocity(const Cone& cone, const typename Cone::Vec& u) {
  typename Cone::Vec result = u;
  for (int group = 0; group < Cone::groups; ++group) {
    double squares = 0;
    for (int k = 0; k < Cone::size(group); ++k) {
      squares += std::pow(u[Cone::start(group) + k], 2);
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

/// Dynamics, bilateral and kinematics but for what they leave to rounding; the rest follows from
/// `Reduced`.
template <class P>
Merit equations(const P& problem, const Solution& given, Reduced& reduced) {
  Merit result;
  const bool mixed = is_mixed(problem);
  const Index d = problem.spacedim;
  const Vector l = mixed ? given.l : Vector::Zero(1);
  reduced.scale.resize(problem.mu.size());
  // impulses that stop velocities of the contacts, each alone
  const auto stopping = [&](const Vector& velocity) {
    Vector impulse = velocity;
    for (Eigen::Index k = 0; k < impulse.size(); ++k) impulse[k] /= reduced.scale[k / d];
    return impulse;
  };
  const auto set_scale = [&](const Eigen::MatrixXd& w) {
    for (Eigen::Index a = 0; a < reduced.scale.size(); ++a) {
      reduced.scale[a] = w.block(d * a, d * a, d, d).trace() / d;
    }
  };
  if constexpr (requires { problem.W; }) {
    const Eigen::MatrixXd w = dense(problem.W);
    const Eigen::MatrixXd v = mixed ? dense(problem.V) : Eigen::MatrixXd::Zero(w.rows(), 1);
    const Eigen::MatrixXd r = mixed ? dense(problem.R) : Eigen::MatrixXd::Identity(1, 1);
    const Vector s = mixed ? problem.s : Vector::Zero(1);
    set_scale(w);
    reduced.q = problem.q;
    reduced.u = w * given.r + v * l + problem.q;
    const Vector held = s.cwiseQuotient(r.diagonal()).cwiseAbs();
    const Vector own = problem.q.cwiseAbs() + sizes(v, held);
    const Vector stop = stopping(by_contact(own, d));
    if (mixed) {
      result.bilateral =
          worst(v.transpose() * given.r + r * l + s,
                at_least(sizes(v.transpose(), stop) + sizes(r, held) + s.cwiseAbs(), s));
    }
    if (given.u.size() > 0) {
      const Vector velocity =
          by_contact(sizes(w, stop) + own, d).cwiseMax(by_contact(reduced.u, d));
      result.kinematics = worst(given.u - reduced.u, at_least(velocity, problem.q));
    }
  } else {
    const Eigen::MatrixXd mass = dense(problem.M);
    const Eigen::MatrixXd h = dense(problem.H);
    const Eigen::Index n = mass.rows();
    const Eigen::MatrixXd g = mixed ? dense(problem.G) : Eigen::MatrixXd::Zero(n, 1);
    const Vector b = mixed ? problem.b : Vector::Zero(1);
    const Eigen::MatrixXd inverse = mass.inverse();
    set_scale(h.transpose() * inverse * h);
    const Vector follows = inverse * (h * given.r + g * l + problem.f);
    const Vector free = inverse * problem.f;
    const Vector v = given.v.size() > 0 ? given.v : follows;
    const Vector fastest = v.cwiseAbs().cwiseMax(free.cwiseAbs());
    reduced.q = h.transpose() * free + problem.w;
    reduced.u = h.transpose() * v + problem.w;
    const Vector s = g.transpose() * free + b;
    if (given.v.size() > 0) {
      const Vector contacts = by_contact(sizes(h.transpose(), free) + problem.w.cwiseAbs(), d);
      Vector stop = sizes(h, stopping(at_least(contacts, reduced.q)));
      if (mixed) {
        const Vector inertia = (g.transpose() * inverse * g).diagonal();
        const Vector joints = at_least(sizes(g.transpose(), free) + b.cwiseAbs(), s);
        stop += sizes(g, joints.cwiseQuotient(inertia));
      }
      result.dynamics = worst(v - follows, fastest.cwiseMax((inverse * stop).cwiseAbs()));
    }
    if (mixed) {
      result.bilateral =
          worst(g.transpose() * v + b, at_least(sizes(g.transpose(), fastest) + b.cwiseAbs(), s));
    }
    if (given.u.size() > 0) {
      const Vector velocity = by_contact(sizes(h.transpose(), fastest) + problem.w.cwiseAbs(), d);
      result.kinematics = worst(given.u - reduced.u, at_least(velocity, reduced.q));
    }
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
  each.u = reduced.u;
  for (Vector* figures : {&each.natural, &each.cone, &each.dual_cone}) figures->resize(nc);
  double squares = 0;
  double scaled_squares = 0;
  double scaled_q = 0;
  double velocity_squares = 0;
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
    const double scaled = natural_norm(cone, u, r, rho);
    scaled_squares += scaled * scaled;
    velocity_squares += std::pow(std::max(scaled / rho, -u[0]), 2);
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
  result.scaled_natural = std::max(std::sqrt(scaled_squares / scaled_q),
                                   std::sqrt(velocity_squares) / reduced.q.norm());
  result.cone = each.cone.maxCoeff();
  result.dual_cone = each.dual_cone.maxCoeff();
  result.error = std::max({result.natural, result.scaled_natural, result.dynamics, result.bilateral,
                           result.kinematics});
  return result;
}

}  // namespace fclib::testing
