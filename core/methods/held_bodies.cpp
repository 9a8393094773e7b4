#include "methods/held_bodies.hpp"

#include <algorithm>
#include <limits>
#include <span>

#include "linalg/groups.hpp"
#include "methods/interior_point.hpp"
#include "methods/proximal_point.hpp"
#include "reduced/gauss_seidel.hpp"
#include "reduced/relative_error.hpp"

namespace fclib {

namespace {

// workshop/tuning/constants.py tries other values of these
constexpr int round_patience = 5;  // rounds in which the error must get better
constexpr double better = 0.5;     // share of the least error below which it got better
constexpr double most_moving =
    0.65;                            // share of the contacts in 2; with more, one try must solve it
constexpr double regular = 1e-9;     // eps for the speed of a body, over the traces of H H^T and M
constexpr double rest_speed = 1e-6;  // [||q||_inf] a slower body rests
constexpr double creep_change = 3;   // factor on creep if 2 was solved and 1 got no better
constexpr double stuck = 0.9;        // share of its last error above which 1 got no better
constexpr double doubt = 1;          // [error of 2, ||q||] slip of a contact that sticks
constexpr double convex_accuracy = 1e-14;  // complementarity and residual of the convex problem
constexpr int convex_limit = 100;          // iterations on a convex problem
constexpr double inner = 0.1;              // tolerance of 2, over that of the whole

// 2 from far away, like the first stages of `auto`: sweeps, then an interior point from their
// result, then a proximal point. If that fails, the last two again from r = 0.
constexpr double interior_above = 1e-3;   // above this error of 1, it is far away
constexpr int first_sweeps = 40;          // sweeps of Gauss-Seidel
constexpr double follow = 4;              // tau of the first interior point, over the error
constexpr double least_tau = 0.03;        // the least such tau
constexpr double most_tau = 1;            // the largest such tau
constexpr double second_tau = 10;         // tau of the second interior point
constexpr double second_cap = 0.8;        // step_cap of the second
constexpr double second_delta = 1e-3;     // delta of the second
constexpr int interior_limit = 60;        // iterations of each
constexpr double short_kappa = 10;        // kappa of the proximal points at first
constexpr std::int64_t short_limit = 80;  // factorisations of each

// 2 from nearby: a proximal point, with long steps at first
constexpr double long_kappa = 1000;
constexpr double long_easy = 10;         // factor on kappa after few Newton steps
constexpr double long_hard = 0.2;        // ... and after a failure
constexpr std::int64_t long_limit = 40;  // factorisations

/// The number of the body of each coordinate. Coordinates that M links belong to one body. So do
/// near ones if one of them feels only contacts that the other feels too: M of a sphere links
/// nothing.
std::vector<Index> bodies(const Primal& primal, int d) {
  const auto count = static_cast<std::size_t>(primal.M.rows());
  Groups groups(static_cast<Index>(count));
  for (Index column = 0; column < primal.M.cols(); ++column) {
    for (SparseColumns::InnerIterator entry(primal.M, column); entry; ++entry) {
      if (entry.value() != 0) groups.link(static_cast<Index>(entry.row()), column);
    }
  }
  std::vector<std::vector<Index>> felt(count);  // contacts, ascending
  for (Index column = 0; column < primal.H.cols(); ++column) {
    for (SparseColumns::InnerIterator entry(primal.H, column); entry; ++entry) {
      std::vector<Index>& own = felt[entry.row()];
      if (entry.value() != 0 && (own.empty() || own.back() != column / d)) {
        own.push_back(column / d);
      }
    }
  }
  constexpr Index reach = 5;  // number of coordinates of a rigid body, less one
  const auto within = [](const std::vector<Index>& some, const std::vector<Index>& all) {
    return !some.empty() && std::includes(all.begin(), all.end(), some.begin(), some.end());
  };
  for (Index k = 0; k < static_cast<Index>(count); ++k) {
    for (Index near = std::max<Index>(0, k - reach); near < k; ++near) {
      if (within(felt[k], felt[near]) || within(felt[near], felt[k])) groups.link(k, near);
    }
  }
  return groups.numbers();
}

/// Some coordinates and some contacts. `place` has the new number of each coordinate; -1: left out.
Primal selected(const Primal& primal, std::span<const Index> place, Index count,
                std::span<const Index> contacts, int d) {
  Primal part;
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (Index column = 0; column < primal.M.cols(); ++column) {
    for (SparseColumns::InnerIterator entry(primal.M, column); entry; ++entry) {
      if (place[entry.row()] < 0 || place[column] < 0) continue;
      entries.emplace_back(place[entry.row()], place[column], entry.value());
    }
  }
  part.M.resize(count, count);
  part.M.setFromTriplets(entries.begin(), entries.end());
  entries.clear();
  Index column = 0;
  for (const Index a : contacts) {
    for (int k = 0; k < d; ++k, ++column) {
      for (SparseColumns::InnerIterator entry(primal.H, d * a + k); entry; ++entry) {
        if (place[entry.row()] < 0) continue;
        entries.emplace_back(place[entry.row()], column, entry.value());
      }
    }
  }
  part.H.resize(count, column);
  part.H.setFromTriplets(entries.begin(), entries.end());
  return part;
}

/// H H^T + eps M. eps is small beside H H^T and large beside its rounding.
SparseColumns squares(const Primal& primal, double eps) {
  SparseColumns product = primal.H * SparseColumns(primal.H.transpose());
  const double share = eps * product.diagonal().sum() / primal.M.diagonal().sum();
  return product + share * primal.M;
}

}  // namespace

template <int D>
HeldBodies<D>::HeldBodies(const ReducedProblem& problem, const Primal& primal,
                          CoupledSystem& system)
    : problem_(problem), primal_(primal), system_(system), body_(bodies(primal, D)) {}

template <int D>
void HeldBodies<D>::solve(const HeldBodiesRules& rules, double tolerance, Report report,
                          FunctionRef<bool()> count) {
  const double enough = inner * tolerance;
  const double size = problem_.q.template lpNorm<Eigen::Infinity>();
  squares_.emplace(squares(primal_, regular), "H H^T");
  shift_ = Vector::Zero(problem_.nc());
  r_ = Vector::Zero(problem_.m());
  double least = std::numeric_limits<double>::infinity();
  double last = least;
  double creep = rules.creep;
  int since = 0;
  for (int round = 0; round < rules.rounds; ++round) {
    if (!convex(count)) return;
    const double error = relative_error<Cone>(problem_, u_, r_);
    if (report(error, r_)) return;
    if (error < better * least) {
      least = error;
      since = 0;
    } else if (++since > round_patience) {
      return;
    }
    Part part;
    if (!release(std::max(rest_speed * size, creep * error * problem_.scale), part) &&
        !release(rest_speed * size, part)) {
      return;
    }
    Vector r = part.problem.known_r;
    double left = 0;
    if (!solve_part(part, error > interior_above, enough, r, left, count)) {
      return;
    }
    // too many bodies were held, or too few
    const bool solved = left <= enough;
    if (!solved && static_cast<double>(part.contacts.size()) > most_moving * problem_.nc()) return;
    if (!solved) {
      creep = std::min(creep * creep_change, rules.creep);
    } else if (error > stuck * last) {
      creep /= creep_change;
    }
    last = error;
    Vector u;
    part.problem.velocity(r, u);
    shift_.setZero();
    for (std::size_t k = 0; k < part.contacts.size(); ++k) {
      const Index a = part.contacts[k];
      const auto at = D * static_cast<Eigen::Index>(k);
      const double slip = u.template segment<D - 1>(at + 1).norm();
      if (slip > doubt * left * problem_.scale) shift_[a] = problem_.friction.mu[a] * slip;
    }
  }
}

template <int D>
bool HeldBodies<D>::solve_part(const Part& part, bool far, double tolerance, Vector& r,
                               double& error, FunctionRef<bool()> count) {
  CoupledSystem system(part.problem);
  Vector u;
  part.problem.velocity(r, u);
  error = relative_error<Cone>(part.problem, u, r);
  bool ended = false;
  const auto proximal = [&](const ProximalRules& own) {
    ProximalPoint<Cone> method(part.problem, system);
    Vector x = r;
    const double found = method.solve(own, tolerance, x, [&](double) { return ended = count(); });
    if (found < error) {
      error = found;
      r = x;
    }
    return ended || error <= tolerance;
  };
  const auto interior = [&](const InteriorPointRules& own, const Vector& start) {
    InteriorPoint<D> method(part.problem, system);
    method.solve(own, start, [&](double found, const Vector& x) {
      if (found < error) {
        error = found;
        r = x;
      }
      return (ended = count()) || error <= tolerance;
    });
    return ended || error <= tolerance;
  };
  const auto sweep = [&] {
    GaussSeidel<Cone> contacts(part.problem);
    Vector x = r;
    for (int k = 0; k < first_sweeps; ++k) contacts.sweep(x, u);
    part.problem.velocity(x, u);
    const double found = relative_error<Cone>(part.problem, u, x);
    if (found < error) {
      error = found;
      r = x;
    }
    return (ended = count()) || error <= tolerance;
  };
  const ProximalRules short_steps{.kappa = short_kappa, .max_factorisations = short_limit};
  const ProximalRules long_steps{
      .kappa = long_kappa, .easy = long_easy, .hard = long_hard, .max_factorisations = long_limit};
  const auto run = [&] {
    if (!far) return proximal(long_steps) || proximal(short_steps);
    if (sweep()) return true;
    const double tau = std::clamp(follow * error, least_tau, most_tau);
    return interior({.tau = tau, .max_iterations = interior_limit}, Vector(r)) ||
           proximal(short_steps) ||
           interior({.tau = second_tau,
                     .step_cap = second_cap,
                     .delta = second_delta,
                     .max_iterations = interior_limit},
                    Vector::Zero(r.size())) ||
           proximal(short_steps);
  };
  run();
  factorisations_ += system.factorisations();
  return !ended;
}

template <int D>
bool HeldBodies<D>::convex(FunctionRef<bool()> count) {
  ReducedProblem shifted = problem_;
  for (Index a = 0; a < problem_.nc(); ++a) {
    shifted.q[D * a] += shift_[a];
    if (shifted.known_u.size() > 0) shifted.known_u[D * a] += shift_[a];
  }
  InteriorPoint<D> method(shifted, system_);
  bool ended = false;
  method.solve({.associated = true,
                .max_iterations = convex_limit,
                .patience = std::numeric_limits<int>::max()},
               Vector::Zero(problem_.m()), [&](double, const Vector& r) {
                 if (r.allFinite()) r_ = r;
                 if (count()) return ended = true;
                 return method.tau() <= convex_accuracy && method.residual() <= convex_accuracy;
               });
  problem_.velocity(r_, u_);
  return !ended;
}

template <int D>
bool HeldBodies<D>::release(double slow, Part& part) {
  const SparseColumns& H = primal_.H;
  const Vector v = squares_->solve(Vector(H * u_));
  part.contacts.clear();
  std::vector<char> moves(body_.size(), 0);  // at the coordinate that names each body
  const auto each_body = [&](Index a, auto&& f) {
    Index last = -1;
    for (int k = 0; k < D; ++k) {
      for (SparseColumns::InnerIterator entry(H, D * a + k); entry; ++entry) {
        if (body_[entry.row()] != last) f(last = body_[entry.row()]);
      }
    }
  };
  for (Index a = 0; a < problem_.nc(); ++a) {
    each_body(a, [&](Index body) {
      if (moves[body]) return;
      double squared = 0;
      for (int k = 0; k < D; ++k) {
        double own = 0;  // what this body alone adds to the velocity
        for (SparseColumns::InnerIterator entry(H, D * a + k); entry; ++entry) {
          if (body_[entry.row()] == body) own += entry.value() * v[entry.row()];
        }
        squared += own * own;
      }
      moves[body] = squared > slow * slow;
    });
  }
  std::vector<Index> place(body_.size(), -1);  // among the coordinates that are not held
  Index free = 0;
  for (std::size_t k = 0; k < body_.size(); ++k) {
    if (moves[body_[k]]) place[k] = free++;
  }
  for (Index a = 0; a < problem_.nc(); ++a) {
    bool touched = false;
    each_body(a, [&](Index body) { touched = touched || moves[body]; });
    if (touched) part.contacts.push_back(a);
  }
  const auto size = static_cast<Eigen::Index>(part.contacts.size());
  if (size == 0) return false;
  part.primal = selected(primal_, place, free, part.contacts, D);

  const Factorization mass(part.primal.M, "M");
  part.problem.W = BlockMatrix(Matrix::from_eigen(mass.gram(part.primal.H)), D);
  part.problem.primal = &part.primal;
  part.problem.scale = problem_.scale;
  part.problem.scaled_scale = problem_.scaled_scale;
  part.problem.deadline = problem_.deadline;
  part.problem.friction.mu.resize(size);
  if (problem_.rho.size() > 0) part.problem.rho.resize(size);
  Vector r(D * size);
  Vector u(D * size);
  for (Eigen::Index k = 0; k < size; ++k) {
    const Index a = part.contacts[static_cast<std::size_t>(k)];
    part.problem.friction.mu[k] = problem_.friction.mu[a];
    if (problem_.rho.size() > 0) part.problem.rho[k] = problem_.rho[a];
    r.template segment<D>(D * k) = r_.template segment<D>(D * a);
    for (int j = 0; j < D; ++j) {
      double held = 0;  // what held bodies add
      for (SparseColumns::InnerIterator entry(H, D * a + j); entry; ++entry) {
        if (place[entry.row()] < 0) held += entry.value() * v[entry.row()];
      }
      u[D * k + j] = u_[D * a + j] - held;
    }
  }
  part.problem.W.multiply_add(-r, u, part.problem.q);
  part.problem.known_r = r;
  part.problem.known_u = u;
  return true;
}

template class HeldBodies<2>;
template class HeldBodies<3>;

}  // namespace fclib
