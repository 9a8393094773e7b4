#include "merit/merit.hpp"

#include <algorithm>
#include <cmath>

#include "contact/coulomb.hpp"
#include "contact/rolling.hpp"
#include "merit/equations.hpp"

namespace fclib {

namespace {

/// ||F|| over ||q||, or over what rounding leaves of q where that is larger; absolute without
/// either.
double relative(Real squares, Real q_squares, Real rounding_squares) {
  const Real scale = std::sqrt(std::max(q_squares, rounding_squares));
  const Real norm = std::sqrt(squares);
  return static_cast<double>(scale > 0 ? norm / scale : norm);
}

void raise(double& largest, Real value) { largest = std::max(largest, static_cast<double>(value)); }

/// The natural map of a contact beyond what the rounding of its q explains.
Real square_beyond(Real norm, Real rounding) {
  const Real left = std::max(Real(0), norm - rounding);
  return left * left;
}

/// The parts that depend on one contact at a time.
template <class Cone>
void judge_contacts(const Friction& friction, const RealVector& r, const Equations& equations,
                    Merit& result, ContactMerits& each) {
  constexpr int D = Cone::dim;
  Real squares = 0;
  Real q_squares = 0;
  Real rounding_squares = 0;
  Real scaled_squares = 0;
  Real scaled_q = 0;
  Real scaled_rounding = 0;
  each.u = equations.u.cast<double>();
  for (Vector* figures : {&each.natural, &each.cone, &each.dual_cone}) {
    figures->resize(friction.mu.size());
  }
  for (Eigen::Index contact = 0; contact < friction.mu.size(); ++contact) {
    const Cone cone(friction, contact);
    const ContactVector<D, Real> ua = equations.u.segment<D>(D * contact);
    const ContactVector<D, Real> ra = r.segment<D>(D * contact);
    const ContactVector<D, Real> modified = cone.modified(ua);
    const Real q_square = equations.q.segment<D>(D * contact).squaredNorm();
    const Real rounding = equations.rounding.segment<D>(D * contact).norm();
    const Real norm = natural_map(cone, ua, ra).norm();
    squares += square_beyond(norm, rounding);
    q_squares += q_square;
    rounding_squares += rounding * rounding;
    const Real rho = equations.scale[contact] > 0 ? 1 / equations.scale[contact] : Real(1);
    scaled_squares += square_beyond(natural_map(cone, ua, ra, rho).norm(), rho * rounding);
    scaled_q += rho * rho * q_square;
    scaled_rounding += rho * rho * rounding * rounding;
    each.natural[contact] = static_cast<double>(norm);
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
  result.natural = relative(squares, q_squares, rounding_squares);
  result.scaled_natural = relative(scaled_squares, scaled_q, scaled_rounding);
}

Merit judge(Index spacedim, const Friction& friction, const Solution& solution,
            const Equations& equations, ContactMerits& each) {
  Merit result;
  for (const Mismatch& mismatch : equations.mismatches) {
    double& member = mismatch.part == "v"   ? result.dynamics
                     : mismatch.part == "u" ? result.kinematics
                                            : result.bilateral;
    member = mismatch.error;
  }
  const RealVector r = solution.r.cast<Real>();
  if (spacedim == 2) {
    judge_contacts<Coulomb<2, Real>>(friction, r, equations, result, each);
  } else if (spacedim == 5) {
    judge_contacts<Rolling<5, Real>>(friction, r, equations, result, each);
  } else if (friction.mu_r.size() > 0) {
    judge_contacts<Rolling<3, Real>>(friction, r, equations, result, each);
  } else {
    judge_contacts<Coulomb<3, Real>>(friction, r, equations, result, each);
  }
  result.error = std::max(result.error_by(MeritKind::natural), result.scaled_natural);
  return result;
}

Equations equations_of(const LocalProblem& problem, const Solution& solution) {
  return equations(problem, solution, own_sizes(problem));
}

Equations equations_of(const GlobalProblem& problem, const Solution& solution) {
  const Factorization mass(to_eigen(problem.M), "M");
  return equations(problem, solution, mass, own_sizes(problem, mass));
}

/// std::max drops a NaN; a solution that holds one must never look good.
template <class P>
Merit judge_valid(const P& problem, const Solution& solution, ContactMerits& each) {
  validate(problem);
  validate(solution, problem);
  const Equations found = equations_of(problem, solution);
  each.mismatches = found.mismatches;
  return judge(problem.spacedim, friction_of(problem), solution, found, each);
}

template <class P>
Merit judge_valid(const P& problem, const Solution& solution) {
  ContactMerits each;
  return judge_valid(problem, solution, each);
}

/// The solution gets the u that follows.
Merit judge_and_complete(Index spacedim, const Friction& friction, const Equations& found,
                         Solution& solution) {
  ContactMerits each;
  const Merit result = judge(spacedim, friction, solution, found, each);
  solution.u = std::move(each.u);
  return result;
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

Merit judge_and_complete(const LocalProblem& problem, const Friction& friction, const OwnSizes& own,
                         Solution& solution) {
  solution.u.resize(0);
  return judge_and_complete(problem.spacedim, friction, equations(problem, solution, own),
                            solution);
}

Merit judge_and_complete(const GlobalProblem& problem, const Friction& friction,
                         const Factorization& mass, const OwnSizes& own, Solution& solution) {
  solution.u.resize(0);
  return judge_and_complete(problem.spacedim, friction, equations(problem, solution, mass, own),
                            solution);
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
