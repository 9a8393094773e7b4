// A small problem as simulators hold it, M v = H r + f and u = H^T v + w, made local:
//
//   W = H^T M^-1 H,   q = H^T M^-1 f + w
//
// M is factorised by Cholesky inside its envelope, in extended precision: what a body does not
// touch costs nothing, and v and u have all digits that the merit asks for. Memory is kept.
#pragma once

#include <cstdint>
#include <vector>

#include "contact/cone.hpp"
#include "embed/small_solver.hpp"
#include "linalg/extended.hpp"

namespace fclib {

template <int D>
class BodyForm {
 public:
  struct Given {
    Index n = 0;                ///< degrees of freedom
    Index nc = 0;               ///< contacts
    const double* M = nullptr;  ///< (n x n), symmetric; its lower triangle by rows is read
    const double* H = nullptr;  ///< (n x m) by columns: the Jacobian H^T by rows
    const double* f = nullptr;  ///< (n)
    const double* w = nullptr;  ///< (m), or null for zeros
  };

  /// Returns what is wrong, or null. The arrays must live while it is used.
  const char* take(const Given& given);

  [[nodiscard]] BlockView W() const { return {starts_.data(), columns_.data(), values_.data()}; }
  [[nodiscard]] const double* q() const { return q_.data(); }

  /// An error of r that is at least the merit's, with u (m) and v (n) if they are not null.
  double judge(const double* mu, const double* r, double* u, double* v);

 private:
  const char* factorise();
  void forward(Real* x, Index first) const;
  void backward(Real* x) const;

  struct Entry {
    Index row;
    double value;
  };

  Given given_;
  std::vector<Index> begin_;     // first column of each row of L
  std::vector<Real> L_;          // (n x n) by rows
  std::vector<Entry> entries_;   // of H, column by column
  std::vector<std::size_t> at_;  // where the entries of each column begin
  std::vector<Real> y_, free_;   // L^-1 f; q
  std::vector<double> q_;
  // rows of L^-1 H that are not zero: of each contact D numbers a row
  std::vector<Index> rows_;
  std::vector<double> half_;
  std::vector<std::size_t> rows_at_;
  std::vector<std::vector<std::pair<Index, std::size_t>>> touch_;  // contacts of each row
  // W by blocks
  std::vector<std::int32_t> starts_, columns_;
  std::vector<double> values_;
  std::vector<std::ptrdiff_t> block_of_;
  // scratch
  std::vector<Real> column_, v_, u_;
  std::vector<double> contact_;
};

extern template class BodyForm<2>;
extern template class BodyForm<3>;

}  // namespace fclib
