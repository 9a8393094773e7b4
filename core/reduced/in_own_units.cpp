#include "reduced/in_own_units.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "linalg/with_dimension.hpp"

namespace fclib {

namespace {

/// ||rho x|| (rho: nc, x: m).
double weighted_norm(const Vector& rho, const Vector& x, int d) {
  double sum = 0;
  for (Eigen::Index a = 0; a < rho.size(); ++a) {
    sum += rho[a] * rho[a] * x.segment(d * a, d).squaredNorm();
  }
  return std::sqrt(sum);
}

/// The scale of errors for q~, if it is `scale` for q.
double scale_for(double scale, double before, double after) {
  return before > 0 && after > 0 ? scale * (after / before) : scale;
}

}  // namespace

double range_of_units(const ReducedProblem& problem) {
  double largest = 0;
  double least = std::numeric_limits<double>::infinity();
  with_dimension(problem.d(), [&](auto dim) {
    const auto trace = [&](Index a) { return problem.W.diagonal_block<dim>(a).trace(); };
    for (Index a = 0; a < problem.nc(); ++a) largest = std::max(largest, trace(a));
    for (Index a = 0; a < problem.nc(); ++a) {
      if (const double own = trace(a); own > nothing_moves * largest) least = std::min(least, own);
    }
  });
  return largest > 0 ? largest / least : 1;
}

InOwnUnits::InOwnUnits(const ReducedProblem& given)
    : units_(given), problem_{.W = given.W.scaled(units_.inverse()), .q = {}, .friction = {}} {
  const int d = given.d();
  problem_.q = units_.q();
  problem_.friction = units_.friction();
  problem_.scale = scale_for(given.scale, given.q.norm(), problem_.q.norm());
  if (given.rho.size() > 0) {
    problem_.rho = given.rho;
    for (Eigen::Index a = 0; a < problem_.rho.size(); ++a) {
      problem_.rho[a] *= units_.unit()[d * a] * units_.unit()[d * a];
    }
    const double before = weighted_norm(given.rho, given.q, d);
    const double after = weighted_norm(problem_.rho, problem_.q, d);
    problem_.scaled_scale = scale_for(given.scaled_scale, before, after);
  }
  if (given.known_r.size() > 0) {
    problem_.known_r = units_.to_own(given.known_r);
    problem_.known_u = units_.to_own_velocities(given.known_u);
  }
  if (given.primal != nullptr) {
    primal_ = {given.primal->M, given.primal->H * units_.inverse().asDiagonal()};
    problem_.primal = &primal_;
  }
  problem_.deadline = given.deadline;
  if (given.proves_no_solution != nullptr) {
    proves_ = [this, d, proves = given.proves_no_solution](const Vector& y) {
      Vector other = y;
      for (Eigen::Index a = 0; a < y.size(); ++a) other[a] *= units_.inverse()[d * a];
      return (*proves)(other);
    };
    problem_.proves_no_solution = &proves_;
  }
}

}  // namespace fclib
