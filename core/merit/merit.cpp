#include "merit/merit.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <optional>

#include "contact/coulomb.hpp"
#include "contact/rolling.hpp"
#include "linalg/factorization.hpp"

namespace fclib {

namespace {

// A referee is more precise than what it judges: with r = 4e5 and q = 0.8, as in granular packings
// under load, the rounding of W r alone is worth 1e-11 in double precision.
using Real = long double;
using RealVector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

RealVector product(const Matrix& a, const RealVector& x) {
  RealVector y = RealVector::Zero(a.rows);
  multiply_add(a, x, y);
  return y;
}

RealVector product_transposed(const Matrix& a, const RealVector& x) {
  RealVector y = RealVector::Zero(a.cols);
  multiply_transposed_add(a, x, y);
  return y;
}

/// || |A| |x| ||: the size of what the product adds up, however much of it cancels. A velocity that
/// vanishes is a sum of terms that do not, and its rounding is relative to them.
Real size_of_product(const Matrix& a, const RealVector& x, bool transposed = false) {
  Matrix sizes = a;
  for (double& value : sizes.x) value = std::abs(value);
  return (transposed ? product_transposed(sizes, x.cwiseAbs()) : product(sizes, x.cwiseAbs()))
      .norm();
}

double relative(Real residual, std::initializer_list<Real> terms) {
  const Real largest = std::max(terms);
  return static_cast<double>(largest > 0 ? residual / largest : residual);
}

void raise(double& largest, Real value) { largest = std::max(largest, static_cast<double>(value)); }

/// The parts that depend on one contact at a time. `scale` is tr(W_aa) / d of each contact.
template <class Cone>
void judge_contacts(const Friction& friction, const RealVector& q, const RealVector& u,
                    const RealVector& r, const RealVector& scale, Merit& result,
                    ContactMerits& each) {
  constexpr int D = Cone::dim;
  Real squares = 0;
  Real scaled_squares = 0;
  Real scaled_q = 0;
  each = {.status = {},
          .u = u.cast<double>(),
          .natural = Vector(friction.mu.size()),
          .cone = Vector(friction.mu.size()),
          .dual_cone = Vector(friction.mu.size())};
  for (Eigen::Index contact = 0; contact < friction.mu.size(); ++contact) {
    const Cone cone(friction, contact);
    const ContactVector<D, Real> ua = u.segment<D>(D * contact);
    const ContactVector<D, Real> ra = r.segment<D>(D * contact);
    const ContactVector<D, Real> modified = cone.modified(ua);
    const Real square = natural_map(cone, ua, ra).squaredNorm();
    squares += square;
    const Real rho = scale[contact] > 0 ? 1 / scale[contact] : Real(1);
    scaled_squares += natural_map(cone, ua, ra, rho).squaredNorm();
    scaled_q += rho * rho * q.segment<D>(D * contact).squaredNorm();
    each.natural[contact] = static_cast<double>(std::sqrt(square));
    each.cone[contact] = static_cast<double>(cone_violation(cone, ra));
    each.dual_cone[contact] = static_cast<double>(dual_violation(cone, modified));
    raise(result.cone, each.cone[contact]);
    raise(result.dual_cone, each.dual_cone[contact]);
    raise(result.complementarity, std::abs(ra.dot(modified)));
    each.status.push_back(status_of(cone, ua, ra, rho));
    switch (each.status.back()) {
      case ContactStatus::open:
        ++result.open;
        break;
      case ContactStatus::stick:
        ++result.stick;
        break;
      case ContactStatus::slide:
        ++result.slide;
        break;
    }
  }
  result.natural = relative(std::sqrt(squares), {q.norm()});
  result.scaled_natural = relative(std::sqrt(scaled_squares), {std::sqrt(scaled_q)});
}

void judge_contacts(Index spacedim, const Friction& friction, const RealVector& q,
                    const RealVector& u, const RealVector& r, const RealVector& scale,
                    Merit& result, ContactMerits& each) {
  const bool rolling = friction.mu_r.size() > 0;
  if (spacedim == 2) {
    judge_contacts<Coulomb<2, Real>>(friction, q, u, r, scale, result, each);
  } else if (spacedim == 5) {
    judge_contacts<Rolling<5, Real>>(friction, q, u, r, scale, result, each);
  } else if (rolling) {
    judge_contacts<Rolling<3, Real>>(friction, q, u, r, scale, result, each);
  } else {
    judge_contacts<Coulomb<3, Real>>(friction, q, u, r, scale, result, each);
  }
  result.error = std::max({result.natural, result.dynamics, result.bilateral, result.kinematics});
}

Merit judge(const LocalProblem& problem, const Friction& friction, const Solution& solution,
            ContactMerits& each, const Factorization*) {
  Merit result;
  const RealVector q = problem.q.cast<Real>();
  const RealVector r = solution.r.cast<Real>();

  // u = W r + V lambda + q
  RealVector u = product(problem.W, r) + q;
  Real largest = std::max(size_of_product(problem.W, r), q.norm());
  if (is_mixed(problem)) {
    const RealVector l = solution.l.cast<Real>();
    const RealVector s = problem.s.cast<Real>();
    u += product(problem.V, l);
    largest = std::max(largest, size_of_product(problem.V, l));
    result.bilateral =
        relative((product_transposed(problem.V, r) + product(problem.R, l) + s).norm(),
                 {size_of_product(problem.V, r, true), size_of_product(problem.R, l), s.norm()});
  }
  if (solution.u.size() > 0) {
    const RealVector given = solution.u.cast<Real>();
    result.kinematics = relative((given - u).norm(), {given.norm(), largest});
  }

  RealVector scale = RealVector::Zero(problem.mu.size());
  for_each_entry(problem.W, [&](Index row, Index col, double value) {
    if (row == col) scale[row / problem.spacedim] += Real(value) / problem.spacedim;
  });
  judge_contacts(problem.spacedim, friction, q, u, r, scale, result, each);
  return result;
}

Merit judge(const GlobalProblem& problem, const Friction& friction, const Solution& solution,
            ContactMerits& each, const Factorization* known) {
  Merit result;
  std::optional<Factorization> made;
  const Factorization& mass = known ? *known : made.emplace(to_eigen(problem.M), "M");
  const RealVector f = problem.f.cast<Real>();
  const RealVector w = problem.w.cast<Real>();
  const RealVector r = solution.r.cast<Real>();

  // M v = H r + G lambda + f
  RealVector momentum = product(problem.H, r) + f;
  Real largest = std::max(size_of_product(problem.H, r), f.norm());
  if (is_mixed(problem)) {
    const RealVector l = solution.l.cast<Real>();
    momentum += product(problem.G, l);
    largest = std::max(largest, size_of_product(problem.G, l));
  }
  RealVector v = solution.v.cast<Real>();
  if (v.size() == 0) {
    v = mass.solve(momentum.cast<double>()).cast<Real>();
  } else {
    result.dynamics = relative((product(problem.M, v) - momentum).norm(),
                               {size_of_product(problem.M, v), largest});
  }
  // of the condensed problem, whose terms do not vanish with v where bodies come to rest
  const RealVector free = mass.solve(problem.f).cast<Real>();
  if (is_mixed(problem)) {
    const RealVector b = problem.b.cast<Real>();
    result.bilateral = relative(
        (product_transposed(problem.G, v) + b).norm(),
        {size_of_product(problem.G, v, true), size_of_product(problem.G, free, true), b.norm()});
  }

  // u = H^T v + w
  const RealVector u = product_transposed(problem.H, v) + w;
  if (solution.u.size() > 0) {
    const RealVector given = solution.u.cast<Real>();
    result.kinematics =
        relative((given - u).norm(), {given.norm(), size_of_product(problem.H, v, true), w.norm()});
  }

  const RealVector q = product_transposed(problem.H, free) + w;
  RealVector scale = RealVector::Zero(problem.mu.size());
  const Vector diagonal = mass.gram_diagonal(to_eigen(problem.H));
  for (Eigen::Index col = 0; col < diagonal.size(); ++col) {
    scale[col / problem.spacedim] += Real(diagonal[col]) / problem.spacedim;
  }
  judge_contacts(problem.spacedim, friction, q, u, r, scale, result, each);
  return result;
}

/// std::max drops a NaN; a solution that holds one must never look good.
template <class P>
Merit judge_valid(const P& problem, const Solution& solution, ContactMerits& each,
                  const Factorization* mass = nullptr) {
  validate(problem);
  validate(solution, problem);
  return judge(problem, friction_of(problem), solution, each, mass);
}

template <class P>
Merit judge_valid(const P& problem, const Solution& solution, const Factorization* mass = nullptr) {
  ContactMerits each;
  return judge_valid(problem, solution, each, mass);
}

template <class P>
ContactMerits judge_each(const P& problem, const Solution& solution) {
  ContactMerits each;
  judge_valid(problem, solution, each);
  return each;
}

}  // namespace

Merit merit(const LocalProblem& problem, const Solution& solution) {
  return judge_valid(problem, solution);
}
Merit merit(const LocalRollingProblem& problem, const Solution& solution) {
  return judge_valid(problem, solution);
}
Merit merit(const GlobalProblem& problem, const Solution& solution) {
  return judge_valid(problem, solution);
}
Merit merit(const GlobalRollingProblem& problem, const Solution& solution) {
  return judge_valid(problem, solution);
}

Merit merit(const GlobalProblem& problem, const Solution& solution, const Factorization& mass) {
  return judge_valid(problem, solution, &mass);
}
Merit merit(const GlobalRollingProblem& problem, const Solution& solution,
            const Factorization& mass) {
  return judge_valid(problem, solution, &mass);
}

ContactMerits contact_merits(const LocalProblem& problem, const Solution& solution) {
  return judge_each(problem, solution);
}
ContactMerits contact_merits(const LocalRollingProblem& problem, const Solution& solution) {
  return judge_each(problem, solution);
}
ContactMerits contact_merits(const GlobalProblem& problem, const Solution& solution) {
  return judge_each(problem, solution);
}
ContactMerits contact_merits(const GlobalRollingProblem& problem, const Solution& solution) {
  return judge_each(problem, solution);
}

}  // namespace fclib
