// M + H D H^T, the matrix of a CoupledSystem on the bodies, and the products with H beside it.
//
// M is n x n, H is n x d nc, and D has nc blocks, d x d. A contact touches few coordinates: its
// columns of H are dense in these. Each thread has a range of coordinates, and the contacts that
// reach into it. Every number is summed in the order of the contacts, whatever the number of
// threads.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "linalg/fronts.hpp"
#include "linalg/workers.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

class BodyMatrix {
 public:
  /// Takes M and H in. Returns the pattern of the matrix, n x n, or nothing if a contact touches so
  /// many coordinates that it would not be sparse.
  [[nodiscard]] std::optional<BlockPattern> analyse(const Primal& primal, int d);

  /// Shares the coordinates out among so many threads. At first one thread has them all.
  void share_out(int threads);

  /// values <- M + H D H^T in the pattern; the blocks of D are d x d, by columns.
  void fill(const std::vector<double>& blocks, std::vector<double>& values, Workers* workers) const;

  /// y <- H x, of length n.
  void to_bodies(const Vector& x, Vector& y, Workers* workers) const;

  /// x <- x - D H^T y.
  void subtract_from_contacts(const std::vector<double>& blocks, const Vector& y, Vector& x,
                              Workers* workers) const;

 private:
  [[nodiscard]] Index contacts() const { return static_cast<Index>(row_first_.size()) - 1; }
  /// Calls f(contact, first coordinate, last + 1) for the contacts that reach into the coordinates
  /// of a thread.
  template <class F>
  void each_of_part(int part, const F& f) const;
  void collect_rows(const SparseColumns& H);
  void copy_columns(const SparseColumns& H);

  int d_ = 3;
  Index size_ = 0;                         // n
  std::vector<std::int64_t> row_first_;    // of each contact, in row_
  std::vector<Index> row_;                 // the coordinates that it touches, ascending
  std::vector<double> h_;                  // its columns of H, in these rows, by columns
  std::vector<std::int64_t> place_first_;  // of each contact, in place_
  std::vector<std::int64_t> place_;  // of the entries of its H D H^T in the values, by columns
  std::vector<std::int64_t> column_first_;  // of each coordinate, in the values
  std::vector<double> fixed_;               // M in the pattern
  std::vector<Index> bounds_;               // of the coordinates of each thread
  std::vector<std::vector<Index>> reach_;   // contacts of each thread; empty if it has all
};

}  // namespace fclib
