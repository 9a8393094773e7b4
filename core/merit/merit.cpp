#include "merit/merit.hpp"

#include <cmath>
#include <optional>
#include <type_traits>

#include "contact/laws.hpp"
#include "error_size.hpp"
#include "joints/consistent.hpp"
#include "merit/equations.hpp"
#include "merit/natural_sums.hpp"

namespace fclib {

namespace {

using std::abs, std::sqrt;  // or those of Real

void raise(double& largest, const Real& value) { largest = larger_error(largest, value); }

/// The rounding of the velocities that friction opposes, by slip_of_rounding. The normal velocity
/// counts as one of the sliding ones. Angular velocities have units of their own.
template <class Cone>
class SlipOfRounding {
 public:
  explicit SlipOfRounding(const RealVector& sizes) : sizes_(sizes) {
    const Eigen::Index contacts = sizes.size() / Cone::dim;
    mean_.fill(Real(0));
    for (Eigen::Index contact = 0; contact < contacts; ++contact) {
      for_each_group<Cone>([&](auto g) { mean_[g] += square(contact, g); });
    }
    for (Real& mean : mean_) mean = sqrt(mean / static_cast<double>(contacts));
  }

  [[nodiscard]] typename Cone::Slack of(Eigen::Index contact) const {
    typename Cone::Slack result;
    for_each_group<Cone>(
        [&](auto g) { result[g] = slip_of_rounding<Real>(sqrt(square(contact, g)), mean_[g]); });
    return result;
  }

 private:
  template <int g>
  [[nodiscard]] Real square(Eigen::Index contact, std::integral_constant<int, g>) const {
    const Eigen::Index at = Cone::dim * contact;
    const Real sum = sizes_.template segment<Cone::size(g)>(at + Cone::start(g)).squaredNorm();
    return g == 0 ? sum + sizes_[at] * sizes_[at] : sum;
  }

  const RealVector& sizes_;
  typename Cone::Slack mean_;
};

/// The parts that depend on one contact at a time. If `each` is null, only the errors.
template <class Cone>
void judge_contacts(const Friction& friction, const Vector& r, const OwnSizes& own,
                    const Equations& equations, Merit& result, ContactMerits* each) {
  constexpr int D = Cone::dim;
  NaturalSums<Cone> sums;
  const SlipOfRounding<Cone> slip(own.q);
  if (each != nullptr) {
    for (Vector* figures : {&each->natural, &each->cone, &each->dual_cone}) {
      figures->resize(friction.mu.size());
    }
  }
  for (Eigen::Index contact = 0; contact < friction.mu.size(); ++contact) {
    const Cone cone(friction, contact);
    const ContactVector<D, Real> ua = equations.u.segment<D>(D * contact);
    const ContactVector<D, Real> ra = r.segment<D>(D * contact).template cast<Real>();
    const Real q_square = own.free_u.segment<D>(D * contact).squaredNorm();
    const Real rounding =
        own.rounding.size() > 0 ? own.rounding.segment<D>(D * contact).norm() : Real(0);
    const auto natural =
        sums.add(cone, ua, ra, q_square, rounding, own.rho[contact], slip.of(contact));
    if (each == nullptr) continue;
    const ContactVector<D, Real> modified = cone.modified(ua);
    each->natural[contact] = error_size(natural.map.norm());
    each->cone[contact] = error_size(cone_violation(cone, ra));
    each->dual_cone[contact] = error_size(dual_violation(cone, modified));
    raise(result.cone, each->cone[contact]);
    raise(result.dual_cone, each->dual_cone[contact]);
    raise(result.complementarity, abs(ra.dot(modified)));
    each->status.push_back(natural.status);
    switch (natural.status) {
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
  result.natural = sums.natural();
  result.scaled_natural = sums.scaled_natural();
}

/// Without `each`, only the errors.
Merit judge(Index spacedim, const Friction& friction, const Solution& solution, const OwnSizes& own,
            const Equations& equations, ContactMerits* each) {
  Merit result;
  for (const Mismatch& mismatch : equations.mismatches) {
    double& member = mismatch.part == "v"   ? result.dynamics
                     : mismatch.part == "u" ? result.kinematics
                                            : result.bilateral;
    member = larger_error(member, mismatch.error);
  }
  with_cone<Real>(spacedim, friction, [&]<class Cone>() {
    judge_contacts<Cone>(friction, solution.r, own, equations, result, each);
  });
  result.error = larger_error(result.error_by(MeritKind::natural), result.scaled_natural);
  return result;
}

/// What a solution is judged by.
struct Grounds {
  OwnSizes own;
  Equations found;
};

Grounds grounds_of(const LocalProblem& problem, const Solution& solution) {
  Grounds result{own_sizes(problem), {}};
  result.found = equations(problem, solution, result.own);
  return result;
}

Grounds grounds_of(const GlobalProblem& problem, const Solution& solution) {
  const Factorization mass(to_eigen(problem.M), "M");
  Grounds result{own_sizes(problem, mass), {}};
  result.found = equations(problem, solution, mass, result.own);
  return result;
}

template <class P>
Merit judge_valid(const P& given, const Solution& solution, ContactMerits& each) {
  validate(given);
  validate(solution, given);
  std::optional<P> consistent;
  if constexpr (std::is_base_of_v<GlobalProblem, P>) {
    if (const auto joints = consistent_joints(given)) consistent = with(given, *joints);
  }
  const P& problem = consistent ? *consistent : given;
  const auto [own, found] = grounds_of(problem, solution);
  each.mismatches = found.mismatches;
  each.u = found.u.template cast<double>();
  return judge(problem.spacedim, friction_of(problem), solution, own, found, &each);
}

template <class P>
Merit judge_valid(const P& problem, const Solution& solution) {
  ContactMerits each;
  return judge_valid(problem, solution, each);
}

/// Sets the u of the solution to the one that follows.
double judge_and_complete(Index spacedim, const Friction& friction, const OwnSizes& own,
                          const Equations& found, MeritKind kind, Solution& solution) {
  const double error = judge(spacedim, friction, solution, own, found, nullptr).error_by(kind);
  solution.u = found.u.cast<double>();
  return error;
}

}  // namespace

template <class P>
Merit merit(const P& problem, const Solution& solution) {
  return judge_valid(problem, solution);
}

template <class P>
ContactMerits contact_merits(const P& problem, const Solution& solution) {
  ContactMerits each;
  judge_valid(problem, solution, each);
  return each;
}

double judge_and_complete(const LocalProblem& problem, const Friction& friction,
                          const OwnSizes& own, MeritKind kind, Solution& solution) {
  solution.u.resize(0);
  return judge_and_complete(problem.spacedim, friction, own, equations(problem, solution, own),
                            kind, solution);
}

double judge_and_complete(const GlobalProblem& problem, const Friction& friction,
                          const Factorization& mass, const OwnSizes& own, MeritKind kind,
                          Solution& solution) {
  solution.u.resize(0);
  return judge_and_complete(problem.spacedim, friction, own,
                            equations(problem, solution, mass, own), kind, solution);
}

#define FCLIB_INSTANTIATE(P)                          \
  template Merit merit<P>(const P&, const Solution&); \
  template ContactMerits contact_merits<P>(const P&, const Solution&);
FCLIB_FOR_EACH_FORMULATION(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
