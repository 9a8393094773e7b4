// Sweeps of Gauss-Seidel on several threads, colour by colour (linalg/colouring.hpp).
//
// A contact reads the reactions of its neighbours by its row of W (there is a copy of the rows in
// the order of the sweep), and writes only its own reaction. So threads wait for each other only at
// the end of a colour, and the result is the same, bit by bit, for any number of threads.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "contact/local_solver.hpp"
#include "function_ref.hpp"
#include "linalg/colouring.hpp"
#include "linalg/workers.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

template <class Cone>
class ColouredSweeps {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;
  using Contact = ContactProblem<Cone>;

  /// With omega, the problems of the contacts have W_aa / omega in place of W_aa.
  ColouredSweeps(const ReducedProblem& problem, double omega, int threads);

  [[nodiscard]] std::size_t colours() const { return colouring_.colours.size() - 1; }

  /// The order of the colours. The caller may shuffle it.
  [[nodiscard]] std::vector<std::size_t>& sequence() { return sequence_; }

  /// Reverses the direction of the sweeps.
  void reverse();

  /// Calls visit(a) once for each contact. visit may write only what belongs to a.
  void sweep(FunctionRef<void(Index)> visit);

  /// Solves the problem of contact a in a sweep. Returns the change of r^a.
  Vec update(Index a, Vector& r, const LocalStep<Cone>& step);

  /// u = W r + q.
  void velocity(const Vector& r, Vector& u);

  /// CPU time of the threads except the calling one [s].
  [[nodiscard]] double cpu_s() const { return workers_.cpu_s(); }

 private:
  /// u = W r + q of the contact at a position of the order.
  [[nodiscard]] Vec velocity_at(std::size_t at, const Vector& r) const;

  /// The largest number of workers that have something to do.
  [[nodiscard]] int most_clusters() const;

  void copy_rows();

  /// The bounds of the workers' shares of each colour: whole clusters, about the same number of
  /// blocks.
  void share_out();

  [[nodiscard]] std::pair<std::size_t, std::size_t> share(std::size_t colour, int k) const;

  const ReducedProblem& problem_;
  Colouring colouring_;
  Workers workers_;
  std::vector<Contact> contacts_;  // by position
  std::vector<std::size_t> sequence_;
  bool backwards_ = false;
  std::vector<std::size_t> position_;  // of each contact in the order
  std::vector<std::size_t> row_;       // first block of the row of each position
  std::vector<Index> column_;          // of each block
  std::vector<double> values_;
  std::vector<std::size_t> shares_;  // of each colour: where each share begins, and the end
};

#define FCLIB_DECLARE(Cone) extern template class ColouredSweeps<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
