// Small problems by projected Gauss-Seidel sweeps, several at once: each has a lane of the
// processor's vector registers. A sweep waits at each contact for the one before, so that one
// problem alone leaves most of the processor idle.
//
// A problem that is done leaves its lane to the next one. What becomes of a problem does not depend
// on the others.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "embed/local_arrays.hpp"
#include "embed/sweep_rule.hpp"
#include "linalg/matrix.hpp"

namespace fclib {

template <int D>
class Lanes {
 public:
  static constexpr int width = 4;
  /// Contacts of a problem. More of them do not fit into the first cache.
  static constexpr Index most_contacts = 8;

  Lanes();

  struct Answer : SweptStart {
    bool solved = false;  ///< else it is for SmallSolver
    /// At least the merit's error, and at most a thousandth of the tolerance above it.
    double error = std::numeric_limits<double>::infinity();
  };

  /// Problems of `nc` contacts. Calls answered(k, answer) for each, in the order in which they
  /// end; those with a block of zeros in W are left to SmallSolver.
  template <class Answered>
  void solve(double tolerance, Index nc, std::int64_t count, const LocalArrays& first,
             const Answered& answered) {
    begin(tolerance, nc);
    const std::int64_t m = D * std::int64_t{nc};
    std::int64_t next = 0;
    int busy = 0;
    for (;;) {
      for (int lane = 0; lane < width; ++lane) {
        while (lanes_[lane].k < 0 && next < count) {
          const std::int64_t k = next++;
          const auto at = [k](auto* array, std::int64_t by) {
            return array == nullptr ? nullptr : array + k * by;
          };
          if (load(lane, k,
                   {at(first.W, m * m), at(first.q, m), at(first.mu, nc), at(first.guess, m),
                    at(first.r, m), at(first.u, m)})) {
            ++busy;
          } else {
            answered(k, Answer{});
          }
        }
      }
      if (busy == 0) return;
      sweep();
      for (int lane = 0; lane < width; ++lane) {
        const std::int64_t k = lanes_[lane].k;
        if (k < 0) continue;
        Answer answer;
        if (!ends(lane, answer)) continue;
        clear(lane);
        --busy;
        answered(k, answer);
      }
    }
  }

 private:
  using Wide = Eigen::Array<double, width, 1>;
  static constexpr int most_rows = D * static_cast<int>(most_contacts);

  struct Lane {
    std::int64_t k = -1;
    LocalArrays arrays{};
    int sweeps = 0;
    double last = 0;             // change of the sweep before
    double size = 0;             // ||W||, of Frobenius
    double friction = 0;         // largest mu
    double least = 0, most = 0;  // of the sizes of the contacts, 1 / rho
    double scale = 1, scaled_scale = 1;
    std::array<double, most_contacts> rho{}, size_of{};  // size_of is 1 / rho
  };

  void begin(double tolerance, Index nc);
  bool load(int lane, std::int64_t k, const LocalArrays& arrays);
  void clear(int lane);
  void sweep();
  bool ends(int lane, Answer& answer);
  bool judge(const Lane& lane, const double* r, double* u, double& error, double& bound) const;

  double tolerance_ = 0;
  int nc_ = 0;
  double root_ = 0;  // of nc
  SweepRule rule_{StepCosts(D, 1, 0)};
  std::array<Lane, width> lanes_;
  std::array<Wide, most_rows * most_rows> W_;  // of each contact, by columns
  std::array<Wide, most_rows> q_, r_;
  std::array<Wide, most_contacts> mu_, normal_, tangent_, square_;
  Wide over_, scaled_over_, change_;  // 1 / ||q||^2, 1 / ||rho q||^2, and of r
};

extern template class Lanes<2>;
extern template class Lanes<3>;

}  // namespace fclib
