// What a simulation keeps from one solve to the next: memory, and the reactions of its contacts.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "embed/matrix_view.hpp"
#include "embed/small_solver.hpp"
#include "error.hpp"
#include "linalg/extended.hpp"
#include "problems/local.hpp"
#include "solve/driver.hpp"

namespace fclib {

/// A local problem in the caller's arrays: u = W r + q and Coulomb's law.
struct LocalView {
  int spacedim = 3;  ///< 2 or 3
  MatrixView W;      ///< (m x m)
  std::span<const double> q;
  std::span<const double> mu;

  LocalView() = default;
  /// Throws Error (problem) if it has bilateral constraints.
  explicit LocalView(const LocalProblem& problem)
      : spacedim(problem.spacedim),
        W(problem.W),
        q(problem.q.data(), static_cast<std::size_t>(problem.q.size())),
        mu(problem.mu.data(), static_cast<std::size_t>(problem.mu.size())) {
    if (problem.s.size() > 0) {
      throw Error(ErrorKind::problem, "are not part of this view", "bilateral constraints");
    }
  }
};

/// Runs one solve after another, in one thread. Nothing is allocated once it has seen the
/// largest problem, except if the solver auto is needed.
class Workspace {
 public:
  struct Settings {
    double tolerance = 1e-8;                                      ///< on Merit::error
    double time_limit = std::numeric_limits<double>::infinity();  ///< wall clock of one solve [s]
    std::function<bool()> poll;  ///< called about ten times a second; false stops the solve
  };

  /// The result. It belongs to the workspace until its next solve.
  struct Answer {
    Status status = Status::diverged;
    std::int64_t iterations = 0;
    double error = 0;                 ///< Merit::error
    const Result* by_auto = nullptr;  ///< what the solver auto found, if it was needed
    std::span<const double> r;        ///< (m)
    std::span<const double> u;        ///< (m)
  };

  /// `contacts` (nc, or empty) are names that contacts keep from one problem to the next. This
  /// solve starts from the reactions that those names had. Without names, if the number of contacts
  /// is that of the last problem, it starts from the last reactions.
  ///
  /// Throws Error (problem) if the data is not valid.
  Answer solve(const LocalView& problem, std::span<const std::int64_t> contacts,
               const Settings& settings);

  /// Writes the reactions of the last solve for these contacts to `r` (spacedim nc); zero for a
  /// contact that had none.
  void guess(int spacedim, std::span<const std::int64_t> contacts, std::span<double> r) const;

  /// Keeps reactions that another method has found.
  void keep(int spacedim, std::span<const std::int64_t> contacts, std::span<const double> r);

  /// Starts from zero again. The memory stays.
  void forget() { known_ = 0; }

 private:
  template <int D>
  Answer solve_in(SmallSolver<D>& solver, const LocalView& problem, const Settings& settings);
  template <int D>
  double judge(const LocalView& problem);

  SmallSolver<2> plane_;
  SmallSolver<3> space_;
  Result whole_;  // of the solver auto
  std::vector<double> r_, u_;
  std::vector<Real> real_, size_;
  // of the last solve
  int spacedim_ = 0;
  std::size_t known_ = 0;                                    // contacts
  std::vector<std::pair<std::int64_t, std::size_t>> names_;  // sorted, with their places
  std::vector<double> last_;
  bool named_ = false;
};

}  // namespace fclib
