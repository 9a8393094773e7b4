#include "chain/chain.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "chain/stages.hpp"
#include "contact/natural_squares.hpp"
#include "linalg/cpu_time.hpp"
#include "reduced/island_bodies.hpp"
#include "reduced/relative_error.hpp"
#include "reduced/with_cone.hpp"

namespace fclib::chain {

namespace {

/// The part of a problem on these contacts. `bodies` are theirs, if they are known.
ReducedProblem restricted(const ReducedProblem& problem, const std::vector<Index>& contacts,
                          const Primal* bodies) {
  const int d = problem.d();
  ReducedProblem part{.W = problem.W.restricted(contacts),
                      .q = {},
                      .friction = {},
                      .scale = problem.scale,
                      .rho = {},
                      .scaled_scale = problem.scaled_scale,
                      .known_r = {},
                      .known_u = {},
                      .primal = bodies,
                      .deadline = problem.deadline};
  const auto count = static_cast<Eigen::Index>(contacts.size());
  if (problem.rho.size() > 0) part.rho = problem.rho(contacts);
  part.q.resize(d * count);
  const bool known = problem.known_r.size() > 0;
  if (known) {
    part.known_r.resize(d * count);
    part.known_u.resize(d * count);
  }
  part.friction = problem.friction.of(contacts);
  for (Eigen::Index k = 0; k < count; ++k) {
    part.q.segment(d * k, d) = problem.q.segment(d * contacts[k], d);
    if (known) {
      part.known_r.segment(d * k, d) = problem.known_r.segment(d * contacts[k], d);
      part.known_u.segment(d * k, d) = problem.known_u.segment(d * contacts[k], d);
    }
  }
  return part;
}

/// Runs the chain from r: on the whole, then on each island that is not solved yet. The result ends
/// in r.
template <class Cone>
void walk(const ReducedProblem& problem, const Table& table, const Resources& resources,
          Tracker& tracker, bool guessed, Vector& r) {
  constexpr int D = Cone::dim;
  const Index nc = problem.nc();
  const double tolerance = tracker.tolerance();
  tracker.set_others(0);
  tracker.set_island(r, {}, D);
  std::optional<Island<Cone>> whole;
  const auto proves = [&](const Vector& y) {
    return problem.proves_no_solution != nullptr && (*problem.proves_no_solution)(y);
  };
  whole.emplace(problem, table, resources, tracker, tolerance, guessed, proves);
  whole->solve(r, On::whole);
  if (tracker.stopped()) return;
  const std::vector<Index> group = problem.W.components();
  const Index count = 1 + *std::max_element(group.begin(), group.end());
  if (count == 1) {
    whole->solve(r, On::islands);
    return;
  }
  whole.reset();

  std::vector<std::vector<Index>> islands(static_cast<std::size_t>(count));
  for (Index a = 0; a < nc; ++a) islands[group[a]].push_back(a);
  Vector u;
  problem.velocity(r, u);
  std::vector<NaturalSquares<double>> parts(islands.size());
  const bool scaled = problem.rho.size() > 0;
  for (Index a = 0; a < nc; ++a) {
    const Cone cone(problem.friction, a);
    const typename Cone::Vec ua = u.template segment<D>(D * a);
    const typename Cone::Vec ra = r.template segment<D>(D * a);
    parts[group[a]].add_plain(cone, ua, ra);
    if (scaled) parts[group[a]].add_scaled(cone, ua, ra, problem.rho[a]);
  }
  double sum = 0;
  std::vector<double> squared;  // errors
  for (const NaturalSquares<double>& part : parts) {
    const double error = part.error(problem.scale, problem.scaled_scale);
    squared.push_back(error * error);
    sum += squared.back();
  }
  std::optional<IslandBodies> bodies;
  if (problem.primal != nullptr) bodies.emplace(*problem.primal);
  for (std::size_t k = 0; k < islands.size() && !tracker.stopped(); ++k) {
    const std::vector<Index>& contacts = islands[k];
    const double share =
        tolerance * std::sqrt(static_cast<double>(contacts.size()) / static_cast<double>(nc));
    if (squared[k] <= share * share) continue;
    Primal own;
    if (bodies) own = bodies->of(contacts, D);
    const ReducedProblem part = restricted(problem, contacts, bodies ? &own : nullptr);
    const auto size = static_cast<Eigen::Index>(contacts.size());
    Vector x(D * size);
    for (Eigen::Index j = 0; j < size; ++j)
      x.template segment<D>(D * j) = r.template segment<D>(D * contacts[j]);
    sum = std::max(0.0, sum - squared[k]);
    tracker.set_others(sum);
    tracker.set_island(r, contacts, D);
    const auto proves_island = [&](const Vector& y) {
      Vector padded = Vector::Zero(nc);
      for (Eigen::Index j = 0; j < size; ++j) padded[contacts[static_cast<std::size_t>(j)]] = y[j];
      return proves(padded);
    };
    const double error =
        Island<Cone>(part, table, resources, tracker, share, guessed, proves_island)
            .solve(x, On::islands);
    sum += error * error;
    for (Eigen::Index j = 0; j < size; ++j)
      r.template segment<D>(D * contacts[j]) = x.template segment<D>(D * j);
  }
}

template <class Cone>
double error_at(const ReducedProblem& problem, const Vector& r) {
  Vector u;
  problem.velocity(r, u);
  const double error = relative_error<Cone>(problem, u, r);
  return std::isfinite(error) ? error : endless;
}

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Table& table, const Resources& resources,
                const Settings& settings, Vector& r) {
  constexpr int D = Cone::dim;
  const Index nc = problem.nc();
  Tracker tracker(settings);
  const double start =
      resources.threads > 1 ? cpu_time() : 0.0;  // the clock takes 0.3 microseconds
  const auto outcome = [&] {
    Outcome result{tracker.stopped().value_or(Status::stalled), tracker.iterations(),
                   std::move(tracker.stages())};
    result.message = tracker.message();
    if (resources.threads > 1) result.cpu_s = cpu_time() - start + tracker.others_cpu();
    return result;
  };
  bool separating = true;
  for (Index a = 0; a < nc && separating; ++a) separating = problem.q[D * a] >= 0;
  if (separating) {
    r.setZero();
    tracker.report(0, 0.0, r);
    return outcome();
  }

  bool guessed = (r.array() != 0).any();
  if (guessed && error_at<Cone>(problem, r) == endless) {
    r.setZero();
    guessed = false;
  }
  walk<Cone>(problem, table, resources, tracker, guessed, r);
  if (guessed && !tracker.stopped() && error_at<Cone>(problem, r) > tracker.tolerance()) {
    Vector cold = Vector::Zero(problem.m());
    walk<Cone>(problem, table, resources, tracker, false, cold);
    if (error_at<Cone>(problem, cold) < error_at<Cone>(problem, r)) r = cold;
  }
  return outcome();
}

}  // namespace

Outcome run(const ReducedProblem& problem, const Table& table, const Resources& resources,
            const Settings& settings, Vector& r) {
  return with_cone(
      problem, [&]<class Cone>() { return iterate<Cone>(problem, table, resources, settings, r); });
}

}  // namespace fclib::chain
