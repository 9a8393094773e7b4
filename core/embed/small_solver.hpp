// Solves problems of a few contacts with Coulomb's cone. Its memory is kept from one problem to the
// next: nothing is allocated once it has seen the largest.
//
//   1  Gauss-Seidel sweeps with exact solutions of each contact, from the guess
//   2  if the sweeps to go cost more than a few factorisations: Newton on the map of Alart &
//      Curnier with a proximal term, since redundant contacts leave W singular; each step is
//      followed by a sweep, which brings it back to the cones
//
// It reports when it has failed. Its callers then use the solver `auto`.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "contact/coulomb.hpp"
#include "contact/exact_contact.hpp"
#include "embed/matrix_view.hpp"

namespace fclib {

template <int D>
class SmallSolver {
 public:
  using Vec = ContactVector<D>;
  using Mat = ContactMatrix<D>;

  /// Takes W (m x m, by rows), q (m) and mu (nc). q and mu must live while r is sought.
  void take(Index nc, const double* W, const double* q, const double* mu);

  /// The same for W in any storage. Returns what is wrong with it, or null.
  const char* take(const MatrixView& W, const double* q, const double* mu);

  /// Improves r (m), a guess on entry, until the error of its natural maps in double precision is
  /// at most the tolerance. Returns whether it is; if not, r is the best iterate.
  bool solve(double tolerance, double* r);

  /// The same until `judge()` of r, the merit's error, is at most the tolerance. If the guess leads
  /// to no solution, it starts again from r = 0. Returns the error.
  template <class Judge>
  double solve(double tolerance, double* r, const Judge& judge) {
    bool guessed = false;
    for (Index k = 0; k < D * nc_ && !guessed; ++k) guessed = r[k] != 0;
    double aim = tolerance;
    // an error that meets the tolerance in double precision may be a little above it
    for (int attempt = 0;; ++attempt) {
      const bool met = solve(aim, r);
      const double error = judge();
      if (error <= tolerance || attempt == 2) return error;
      if (met) {
        aim *= 0.1;
      } else if (guessed) {
        std::fill_n(r, D * nc_, 0.0);
        guessed = false;
      } else {
        return error;
      }
    }
  }

  /// Sweeps and Newton steps since it got the problem.
  [[nodiscard]] std::int64_t iterations() const { return iterations_; }

 private:
  void resize(Index nc);
  void prepare();
  [[nodiscard]] Vec coupled(Index a, const double* r) const;
  [[nodiscard]] Vec velocity(Index a, const double* r) const;
  double sweep(double* r);
  [[nodiscard]] double error(const double* r) const;
  bool newton(int attempt, double tolerance, double* r, double& best);
  bool newton_step(double weight_of_mean, double* r);
  bool keep(double error, const double* r, double& best);
  [[nodiscard]] double sweep_cost() const;
  [[nodiscard]] double newton_cost() const;

  static Eigen::Map<const Vec> part(const double* x, Index a) {
    return Eigen::Map<const Vec>(x + D * a);
  }
  static Eigen::Map<Vec> part(double* x, Index a) { return Eigen::Map<Vec>(x + D * a); }

  Index nc_ = 0;
  const double* q_ = nullptr;
  const double* mu_ = nullptr;
  double scale_ = 1;         // ||q||
  double scaled_scale_ = 1;  // ||rho q||
  bool solvable_ = true;     // no contact has failed alone
  std::int64_t iterations_ = 0;
  // W by blocks; the diagonal ones are apart
  std::vector<Mat> diagonal_, blocks_;
  std::vector<std::size_t> row_;  // where the blocks of each contact begin, and where they end
  std::vector<Index> column_;     // of each block
  std::vector<ExactContact<D>> contacts_;
  std::vector<double> rho_;
  // scratch
  std::vector<double> best_, last_, z_, system_;
  std::vector<Index> place_;  // place of each contact that is not open in Newton's system
  std::vector<std::size_t> entry_row_;
  struct Entry {
    Index col;
    double value;
    int component;
  };
  std::vector<Entry> entries_;
  std::vector<std::ptrdiff_t> block_of_;
};

extern template class SmallSolver<2>;
extern template class SmallSolver<3>;

}  // namespace fclib
