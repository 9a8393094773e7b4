// Solves problems of a few contacts with Coulomb's cone. Its memory is kept from one problem to the
// next: nothing is allocated once it has seen the largest.
//
// Contacts that no block of W connects are islands. Each is solved alone:
//
//   1  Gauss-Seidel sweeps of projected steps, as long as few are foreseen
//   2  Gauss-Seidel sweeps with solutions of each contact
//   3  if the sweeps to go cost more than a few factorisations: Newton on the map of Alart &
//      Curnier with a proximal term, since redundant contacts leave W singular; each step is
//      followed by a sweep, which brings it back to the cones
//
// It reports when it has failed. Its callers then use the solver `auto`.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "contact/coulomb.hpp"
#include "contact/exact_contact.hpp"
#include "contact/natural_squares.hpp"
#include "embed/matrix_view.hpp"
#include "embed/sweep_rule.hpp"

namespace fclib {

/// W by blocks, in the caller's arrays: the rows of blocks one after another, as in a matrix by
/// rows.
struct BlockView {
  const std::int32_t* starts = nullptr;   ///< where the blocks of each contact begin (nc + 1)
  const std::int32_t* columns = nullptr;  ///< the other contact of each block
  const double* values = nullptr;         ///< the blocks (D x D), each by rows
};

template <int D>
class SmallSolver {
 public:
  using Vec = ContactVector<D>;
  using Mat = ContactMatrix<D>;

  /// Takes W (m x m, by rows), q (m) and mu (nc). q and mu must live while r is sought. Returns
  /// what is wrong with W, or null.
  const char* take(Index nc, const double* W, const double* q, const double* mu);

  /// The same for W in any storage. If the next W has the same pattern, its places are known.
  const char* take(const MatrixView& W, const double* q, const double* mu);

  /// The same for W by blocks.
  const char* take(Index nc, const BlockView& W, const double* q, const double* mu);

  /// Improves r (m), a guess on entry, until `judge()` of r, the merit's error, is at most the
  /// tolerance. An island whose guess leads to no solution starts again from r = 0. Returns an
  /// error that is at least the merit's, and at most a thousandth of the tolerance above it. If
  /// rounding cannot matter to that, the error is found in double precision, without `judge()`, but
  /// not if W and q are themselves rounded (`exact`).
  template <class Judge>
  double solve(double tolerance, double* r, const Judge& judge, bool exact = true) {
    double aim = tolerance;
    tolerance_ = tolerance;
    bounds_ = exact && can_bound();
    // an error that meets the tolerance in double precision may be a little above it
    for (int attempt = 0;; ++attempt) {
      bool met = true;
      bound_ = std::numeric_limits<double>::infinity();
      for (std::size_t k = 0; k < islands_; ++k) met = solve_island(k, aim, r) && met;
      if (met && bounds_) {
        if (!(bound_ <= tolerance)) bound_error(tolerance, r);
        in_u_ = bound_ <= tolerance;
        if (in_u_) return bound_;
      }
      in_u_ = false;
      const double error = judge();
      if (error <= tolerance || attempt == 2 || !met) return error;
      aim *= 0.1;
    }
  }

  /// From now on a solve gives up once `stop` is true; it is asked after each sweep and each step
  /// of Newton's method. Empty: never.
  void stop_if(std::function<bool()> stop) { stop_ = std::move(stop); }

  /// Says that the next solve starts from where projected sweeps ended. It makes no more of them.
  void start_behind(const SweptStart& start) {
    iterations_ += start.sweeps;
    if (islands_ == 1) swept_ = start.change;
  }

  /// Whether the last solve has left W r + q in `velocities()`, without `judge()`.
  [[nodiscard]] bool has_velocities() const { return in_u_; }
  [[nodiscard]] const double* velocities() const { return u_.data(); }

  /// The merit of r in extended precision, and u = W r + q if it is not null.
  double judge(const double* r, double* u) const;

  /// W, for another solver.
  [[nodiscard]] Matrix matrix() const;

  /// Sweeps and Newton steps since it got the problem, of all islands.
  [[nodiscard]] std::int64_t iterations() const { return iterations_; }

  [[nodiscard]] std::size_t islands() const { return islands_; }
  /// Contacts of the largest island.
  [[nodiscard]] Index largest() const { return largest_; }

 private:
  using Contacts = std::span<const Index>;

  [[nodiscard]] bool stopped() const { return stop_ && stop_(); }

  /// How the W of the last call was stored, if that is known.
  enum class Pattern { none, triplet, csc, csr, blocks };

  void resize(Index nc);
  void prepare(const double* q, const double* mu);
  void find_islands();
  const char* take_dense_by_columns(const MatrixView& W, const double* q, const double* mu);
  const char* learn(const MatrixView& W);
  void know(Pattern kind, std::span<const Index> p, std::span<const Index> i);
  [[nodiscard]] bool knows(Pattern kind, Index nc, std::span<const Index> p,
                           std::span<const Index> i) const;
  [[nodiscard]] Contacts island(std::size_t k) const {
    return {members_.data() + first_[k], static_cast<std::size_t>(first_[k + 1] - first_[k])};
  }
  [[nodiscard]] Vec coupled(Index a, const double* r) const;
  [[nodiscard]] Vec velocity(Index a, const double* r) const;
  bool solve_island(std::size_t k, double tolerance, double* r);
  bool seek(double tolerance, double* r);
  double projected_sweep(double* r);
  bool project(double tolerance, double* r, double& change);
  double sweep(double* r);
  void add_to(NaturalSquares<double>& squares, Index a, const double* r) const;
  [[nodiscard]] double error(const double* r) const;
  [[nodiscard]] bool can_bound() const;
  bool bound_error(double aim, const double* r);
  bool meets(double tolerance, const double* r);
  bool newton(int attempt, double tolerance, double* r, double& best);
  bool newton_step(double weight_of_mean, double* r);
  bool keep(double error, const double* r, double& best);
  void restore(double* r) const;
  [[nodiscard]] StepCosts costs() const { return {D, now_.size(), blocks_now_}; }

  static Eigen::Map<const Vec> part(const double* x, Index a) {
    return Eigen::Map<const Vec>(x + D * a);
  }
  static Eigen::Map<Vec> part(double* x, Index a) { return Eigen::Map<Vec>(x + D * a); }

  std::function<bool()> stop_;
  Index nc_ = 0;
  const double* q_ = nullptr;
  const double* mu_ = nullptr;
  double whole_scale_ = 1;         // ||q||
  double whole_scaled_scale_ = 1;  // ||rho q||
  bool squares_hold_ = true;       // in double precision
  double tolerance_ = 0;           // of the whole
  bool bounds_ = false;            // whether a bound on the error may do
  double bound_ = 0;               // of the last r that met the tolerance
  std::int64_t iterations_ = 0;
  double swept_ = -1;  // the change of sweeps made elsewhere
  // W by blocks; the diagonal ones are apart
  std::vector<Mat> diagonal_, blocks_;
  std::vector<std::size_t> row_;  // where the blocks of each contact begin, and where they end
  std::vector<Index> column_;     // of each block
  std::vector<ExactContact<D>> contacts_;
  std::vector<double> rho_;
  struct Step {  // of projected sweeps
    double normal, tangent;
    double square;  // of the size of the contact's W
  };
  std::vector<Step> steps_;
  // islands: the contacts of each, in order
  std::size_t islands_ = 0;
  Index largest_ = 0;
  std::vector<Index> members_, first_, root_;
  // the one that is being solved
  Contacts now_;
  double scale_ = 1;           // its share of ||q||
  double scaled_scale_ = 1;    // ... of ||rho q||
  double close_ = 0;           // how exactly a sweep solves its contacts, as a velocity
  double close_of_error_ = 0;  // ... so that the error is 1
  std::size_t blocks_now_ = 0;
  bool solvable_ = true;  // no contact has failed alone
  // the pattern of the last W that was sparse, and where its entries (or blocks) go
  Pattern known_ = Pattern::none;
  std::vector<Index> known_p_, known_i_;
  std::size_t known_p_size_ = 0, known_i_size_ = 0;
  std::vector<std::ptrdiff_t> where_;
  // scratch
  std::vector<double> best_, system_, u_, by_rows_;
  bool in_u_ = false;
  std::vector<Index> place_;  // place of each contact that is not open in Newton's system
  std::vector<std::size_t> entry_row_;
  struct Entry {
    Index col;
    int component;
    std::size_t number;
  };
  std::vector<Entry> entries_;
  std::vector<std::ptrdiff_t> block_of_;
};

extern template class SmallSolver<2>;
extern template class SmallSolver<3>;

}  // namespace fclib
