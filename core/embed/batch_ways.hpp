// How one problem of a batch is solved: Coulomb's law by a method of its own, other laws by `auto`.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "convert/complete.hpp"
#include "embed/alone.hpp"
#include "embed/body_form.hpp"
#include "embed/lanes.hpp"
#include "embed/small_solver.hpp"
#include "merit/merit.hpp"
#include "problem.hpp"
#include "solve/driver.hpp"

namespace fclib::batch {

/// If an island is larger, the problem is for `auto`: the small solver is dense, `auto` is not.
inline constexpr Index most_contacts = 64;

/// One problem, in the caller's arrays.
struct One {
  Index spacedim;
  bool coupled;
  Index nc;
  const double* W;
  const double* q;
  BlockView blocks;
  Index n;
  const double* M;
  const double* H;
  const double* f;
  const double* w;
  const double* mu;
  const double* mu_r;
  const double* mu_s;
  const double* guess;
  double* r;
  double* u;
  double* v;
};

inline bool all_finite(const double* x, std::int64_t size) {
  double sum = 0;  // zero, or NaN: without a branch
  for (std::int64_t k = 0; k < size; ++k) sum += x[k] * 0.0;
  return sum == 0;
}

inline constexpr const char* not_finite = "has an entry that is not finite";

/// What is wrong with coefficients of friction, or an empty text.
inline std::string wrong_friction(const char* name, const double* mu, Index nc) {
  for (Index a = 0; mu != nullptr && a < nc; ++a) {
    if (mu[a] >= 0 && std::isfinite(mu[a])) continue;
    return std::string(name) + ": contact " + std::to_string(a) + " has " + std::to_string(mu[a]) +
           ", expected a finite number that is not negative";
  }
  return {};
}

/// What is wrong with the vectors of a problem, or an empty text.
inline std::string wrong_vectors(const One& one, std::int64_t m) {
  if (one.M == nullptr && !all_finite(one.q, m)) return std::string("q: ") + not_finite;
  if (one.guess != nullptr && !all_finite(one.guess, m)) {
    return std::string("guess: ") + not_finite;
  }
  return wrong_friction("mu", one.mu, one.nc);
}

/// The global problem, with Coulomb's law or another one.
template <class Problem>
void make_global(const One& one, Index m, Problem& problem) {
  problem.f = Eigen::Map<const Vector>(one.f, one.n);
  problem.w = Vector::Zero(m);
  if (one.w != nullptr) problem.w = Eigen::Map<const Vector>(one.w, m);
  problem.M.storage = problem.H.storage = Storage::triplet;
  problem.M.rows = problem.M.cols = problem.H.rows = one.n;
  problem.H.cols = m;
  const auto add = [](Matrix& matrix, Index row, Index col, double value) {
    if (value == 0) return;
    matrix.i.push_back(row);
    matrix.p.push_back(col);
    matrix.x.push_back(value);
  };
  for (Index row = 0; row < one.n; ++row) {
    for (Index col = 0; col <= row; ++col) {
      const double value = one.M[static_cast<std::int64_t>(one.n) * row + col];
      add(problem.M, row, col, value);
      if (col < row) add(problem.M, col, row, value);
    }
  }
  for (Index col = 0; col < m; ++col) {
    for (Index row = 0; row < one.n; ++row) {
      add(problem.H, row, col, one.H[static_cast<std::int64_t>(one.n) * col + row]);
    }
  }
}

/// Coulomb's law: the small solver, which allocates nothing.
template <int D>
class SmallWay {
 public:
  /// Takes the data. Returns what is wrong with them, or an empty text.
  std::string take(const One& one) {
    if (std::string wrong = wrong_vectors(one, D * std::int64_t{one.nc}); !wrong.empty()) {
      return wrong;
    }
    const char* wrong = nullptr;
    if (one.M != nullptr) {
      wrong = bodies_.take({one.n, one.nc, one.M, one.H, one.f, one.w});
      if (wrong != nullptr) return wrong;
      wrong = solver_.take(one.nc, bodies_.W(), bodies_.q(), one.mu);
    } else if (one.blocks.starts != nullptr) {
      wrong = solver_.take(one.nc, one.blocks, one.q, one.mu);
    } else {
      wrong = solver_.take(one.nc, one.W, one.q, one.mu);
    }
    return wrong == nullptr ? std::string() : std::string("W: ") + wrong;
  }

  /// Problems of few contacts are solved several at once.
  static constexpr bool has_lanes = true;
  Lanes<D>& lanes() { return lanes_; }
  static void solve_alone(double tolerance, int count, const LocalArrays& first, Alone& found) {
    fclib::solve_alone<D>(tolerance, count, first, found);
  }

  /// As SmallSolver::start_behind.
  void start_behind(const SweptStart& start) { solver_.start_behind(start); }

  /// The merit's error of r, and u and v.
  double judge(const One& one) {
    if (one.M != nullptr) return bodies_.judge(one.mu, one.r, one.u, one.v);
    return solver_.judge(one.r, one.u);
  }

  /// The error that r has now, and the iterations; nothing if the problem is for `auto`.
  std::optional<std::pair<double, std::int64_t>> solve(const One& one, double tolerance) {
    if (solver_.largest() > most_contacts) return {};
    const double error =
        solver_.solve(tolerance, one.r, [&] { return judge(one); }, one.M == nullptr);
    if (!(error <= tolerance)) return {};
    if (solver_.has_velocities() && one.u != nullptr) {
      std::copy_n(solver_.velocities(), D * one.nc, one.u);
    }
    return std::pair(error, solver_.iterations());
  }

  /// visit(problem), for another solver.
  template <class Visitor>
  Result with_problem(const One& one, const Visitor& visit) const {
    const Index m = D * one.nc;
    const auto of = [&](auto problem) {
      problem.spacedim = D;
      problem.mu = Eigen::Map<const Vector>(one.mu, one.nc);
      return problem;
    };
    if (one.M != nullptr) {
      auto problem = of(GlobalProblem{});
      make_global(one, m, problem);
      return visit(problem);
    }
    auto problem = of(LocalProblem{});
    problem.q = Eigen::Map<const Vector>(one.q, m);
    problem.W = solver_.matrix();
    return visit(problem);
  }

 private:
  SmallSolver<D> solver_;
  BodyForm<D> bodies_;
  Lanes<D> lanes_;
};

/// Rolling and spin friction: `auto` for each.
class WholeWay {
 public:
  static constexpr bool has_lanes = false;
  void start_behind(const SweptStart&) {}

  std::string take(const One& one) {
    d_ = one.spacedim;
    const Index m = d_ * one.nc;
    std::string wrong = wrong_vectors(one, m);
    if (wrong.empty()) wrong = wrong_friction("mu_s", one.mu_s, one.nc);
    if (wrong.empty()) wrong = wrong_friction("mu_r", one.mu_r, one.nc);
    if (!wrong.empty()) return wrong;
    const bool spin = one.mu_s != nullptr;
    try {
      if (one.M != nullptr) {
        if (spin) {
          make_global(one, m, make<GlobalSpinProblem>(one));
        } else {
          make_global(one, m, make<GlobalRollingProblem>(one));
        }
      } else if (spin) {
        make_local(one, m, make<LocalSpinProblem>(one));
      } else {
        make_local(one, m, make<LocalRollingProblem>(one));
      }
      std::visit([](const auto& problem) { validate(problem); }, problem_);
      // M must have an inverse, which is found out here
      solution_ = completed(Vector::Zero(m));
    } catch (const Error& error) {
      return error.what();
    }
    return {};
  }

  double judge(const One& one) {
    const Index m = d_ * one.nc;
    solution_ = completed(Eigen::Map<const Vector>(one.r, m));
    if (one.u != nullptr) std::copy_n(solution_.u.data(), m, one.u);
    if (one.v != nullptr) std::copy_n(solution_.v.data(), one.n, one.v);
    return std::visit([&](const auto& problem) { return merit(problem, solution_).error; },
                      problem_);
  }

  static std::optional<std::pair<double, std::int64_t>> solve(const One&, double) { return {}; }

  template <class Visitor>
  Result with_problem(const One&, const Visitor& visit) const {
    return std::visit([&](const auto& problem) { return visit(problem); }, problem_);
  }

 private:
  template <class P>
  P& make(const One& one) {
    auto& problem = problem_.template emplace<P>();
    problem.spacedim = d_;
    problem.mu = Eigen::Map<const Vector>(one.mu, one.nc);
    if (one.mu_r != nullptr) problem.mu_r = Eigen::Map<const Vector>(one.mu_r, one.nc);
    if constexpr (P::spin) {
      problem.mu_s = Eigen::Map<const Vector>(one.mu_s, one.nc);
      problem.coupled = one.coupled ? 1 : 0;
    }
    return problem;
  }

  template <class P>
  void make_local(const One& one, Index m, P& problem) const {
    problem.q = Eigen::Map<const Vector>(one.q, m);
    if (one.blocks.starts == nullptr) {
      problem.W.storage = Storage::dense;
      problem.W.rows = problem.W.cols = m;
      problem.W.x.resize(static_cast<std::size_t>(m) * static_cast<std::size_t>(m));
      // by rows there, by columns here
      Eigen::Map<Eigen::MatrixXd>(problem.W.x.data(), m, m) =
          Eigen::Map<const Eigen::MatrixXd>(one.W, m, m).transpose();
      return;
    }
    problem.W.storage = Storage::triplet;
    problem.W.rows = problem.W.cols = m;
    const double* value = one.W;
    for (Index a = 0; a < one.nc; ++a) {
      for (Index k = one.blocks.starts[a]; k < one.blocks.starts[a + 1]; ++k) {
        for (Index i = 0; i < d_; ++i) {
          for (Index j = 0; j < d_; ++j) {
            problem.W.i.push_back(d_ * a + i);
            problem.W.p.push_back(d_ * one.blocks.columns[k] + j);
            problem.W.x.push_back(*value++);
          }
        }
      }
    }
  }

  [[nodiscard]] Solution completed(const Vector& r) const {
    return std::visit(
        [&](const auto& problem) {
          return complete(problem, Solution{.v = {}, .u = {}, .r = r, .l = {}});
        },
        problem_);
  }

  Index d_ = 0;
  std::variant<LocalRollingProblem, LocalSpinProblem, GlobalRollingProblem, GlobalSpinProblem>
      problem_;
  Solution solution_;
};

}  // namespace fclib::batch
