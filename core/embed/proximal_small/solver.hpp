// Local problems of a few contacts, each solved by a group of lanes: a thread, a team of threads, a
// part of a warp, or a block of a GPU. Plain C++, so that NVRTC compiles it for the device.
//
// The method is the proximal point algorithm of methods/proximal_point.hpp, with the same rules:
//
//   from r = guess or 0, until the error of r is at most the tolerance:
//     find p = A(r - rho (W p + q)), rho_a = kappa d / tr(W_aa)   by a semismooth Newton method
//     r = p, put into the cones
//     kappa grows if Newton's method took few steps, and falls if it failed
//
// A is the map of Alart & Curnier. A step of Newton's method is, with D = rho A',
//
//   W given (Dense)             (I + D W) dp = -F
//   W = B B^T given (Bodies)    (I + B^T D B) dv = -B^T F,  dp = -F - D B dv,  B = J M^-1/2
//
// A sweep of Gauss-Seidel goes from contact to contact. Here every lane has its contacts, and all
// of them work at once: that is why a GPU has this method and not the one of small_solver.hpp.
//
// The groups of a warp go through the same statements in step: what differs between problems is
// data and never a branch around a `sync`. `Group::anyone` asks all groups that run in step.
#pragma once

#include "embed/proximal_small/numbers.hpp"

namespace fclib::proximal_small {

/// How a problem ended.
enum class Ending {
  converged,  ///< the error, recomputed from r, is at most the tolerance
  unsolved,   ///< the best r that was found; for the solver `auto`
  invalid,    ///< an entry that is not finite, or a negative mu
};

/// kappa and the factors of its growth are those of ppa-nsn with a smaller kappa to begin with:
/// from 1 to 30, problems of 4 to 64 contacts take the same number of Newton steps within a tenth,
/// and more from 100 on.
struct Rules {
  double tolerance = 1e-8;
  double kappa = 10;
  double kappa_max = 1e8;
  double easy = 3;       ///< factor after 1 or 2 Newton steps; after 3 or 4, two thirds of it
  double hard = 0.5;     ///< factor after a failure
  int most_steps = 400;  ///< Newton steps of one problem
};

struct Answer {
  Ending ending = Ending::unsolved;
  double error = FCLIB_INFINITY;  ///< the larger of both maps
  int steps = 0;                  ///< of Newton's method
};

/// Solves one problem after another with its memory. `Own` is the largest number of contacts of a
/// lane. All members are called by all lanes of the groups that run in step; `mine` says whose
/// problem it is.
template <class System, int Own>
class Solver {
 public:
  using Law = typename System::Law;
  using Group = typename System::Group;
  static constexpr int D = Law::dim;
  using Vectors = double[Own][D];

  System system;
  Rules rules;

  /// Where r and u of the problem go, each (m).
  struct Result {
    double* r;
    double* u;
  };

  /// Begins a problem. limits (groups x nc): mu of each contact, then mu_r.
  FCLIB_LANES void begin(bool mine, int nc, const typename System::Given& given,
                         const double* const (&limits)[Law::groups], const double* guess,
                         const Result& result) {
    const Group& group = system.group;
    double size[Own] = {};
    bool bad = system.take(mine, nc, given, q_, size);
    double sums[4] = {0, 0, 0, 0};  // of the sizes, their number, bad entries, contacts that close
    if (mine) {
      result_ = result;
      FCLIB_UNROLL
      for (int o = 0; o < Own; ++o) {
        const int a = group.lane() + o * Group::size;
        if (a >= nc) break;
        FCLIB_UNROLL
        for (int g = 0; g < Law::groups; ++g) {
          law_[o].limit[g] = limits[g][a];
          bad = bad || !(law_[o].limit[g] >= 0) || !is_finite(law_[o].limit[g]);
        }
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) {
          r_[o][k] = guess != nullptr ? guess[D * a + k] : 0.0;
          bad = bad || !is_finite(r_[o][k]);
        }
        if (size[o] > 0) {
          sums[0] += size[o];
          sums[1] += 1;
        }
        if (!(q_[o][0] >= 0)) sums[3] = 1;
      }
    }
    if (bad) sums[2] = 1;
    group.sum(sums);
    const double other = sums[1] > 0 ? sums[1] / sums[0] : 1.0;
    double squares[4] = {0, 0, 0, 0};  // of q, of rho q, of numbers without one, entries of q
    if (mine) {
      answer_ = Answer{};
      FCLIB_UNROLL
      for (int o = 0; o < Own; ++o) {
        const int a = group.lane() + o * Group::size;
        if (a >= nc) break;
        rho_[o] = size[o] > 0 ? 1 / size[o] : other;
        double square = 0;
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) {
          square += q_[o][k] * q_[o][k];
          if (q_[o][k] != 0) squares[3] = 1;
          if (sums[3] == 0) r_[o][k] = 0;  // all contacts are open
        }
        if (!has_square(rho_[o])) squares[2] = 1;
        squares[0] += square;
        squares[1] += rho_[o] * rho_[o] * square;
      }
    }
    group.sum(squares);
    if (mine) {
      mean_ = nc > 0 ? square_root(squares[0] / nc) : 0.0;
      scale_ = squares[0] > 0 ? 1 / square_root(squares[0]) : 1.0;
      scaled_scale_ = squares[1] > 0 ? 1 / square_root(squares[1]) : 1.0;
      // nobody knows the error, and the problem is left
      if (squares[2] > 0 || (squares[3] > 0 && !(has_square(square_root(squares[0])) &&
                                                 has_square(square_root(squares[1]))))) {
        scale_ = FCLIB_INFINITY;
      }
      kappa_ = rules.kappa;
      cautious_ = 0;
    }
    if (mine) {
      state_ = State::begun;
      if (sums[2] > 0) {
        answer_.ending = Ending::invalid;
        FCLIB_UNROLL
        for (int o = 0; o < Own; ++o) {
          FCLIB_UNROLL
          for (int k = 0; k < D; ++k) r_[o][k] = FCLIB_INFINITY - FCLIB_INFINITY;  // NaN
        }
        copy(r_, u_);
        write();
      }
    }
  }

  FCLIB_LANES bool finished() const {
    return answer_.error <= rules.tolerance || answer_.ending == Ending::invalid ||
           answer_.steps >= rules.most_steps || kappa_ < least_kappa;
  }
  [[nodiscard]] FCLIB_LANES const Answer& answer() const { return answer_; }

  /// One step of Newton's method. Before it, the proximal step that the last one may have finished
  /// is judged, or the guess.
  FCLIB_LANES void advance(bool mine) {
    const bool candidate = mine && !finished() && state_ != State::inside;
    if (system.group.anyone(candidate)) judge_candidate(candidate);
    const bool solving = mine && !finished();
    if (system.group.anyone(solving)) newton_step(solving);
  }

 private:
  static constexpr int most_inner = 20;
  static constexpr int most_halvings = 5;
  static constexpr double least_kappa = 1e-6;

  enum class State {
    begun,   ///< r is the guess; nothing is known of it
    inside,  ///< Newton's method is on its way from r to p
    solved,  ///< p solves the inner problem, as far as its residual tells
  };

  FCLIB_LANES void judge_candidate(bool mine) {
    Vectors x{}, ux{};
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (system.group.lane() + o * Group::size >= system.nc) break;
      double z[D];
      argument(o, up_, z);
      law_[o].into_cone(z, p_[o], x[o]);
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) x[o][k] = state_ == State::begun ? r_[o][k] : x[o][k];
    }
    product(x, ux);
    double gap;
    const double error = judge(x, ux, gap);
    if (!mine) return;
    const bool begun = state_ == State::begun;
    state_ = State::inside;
    const bool taken =
        begun || gap <= 0.1 * error || gap <= 1e-15 || exact_ || error <= rules.tolerance;
    if (taken) {
      copy(x, r_);
      copy(ux, u_);
      accept(error);
      if (!begun) {
        double growth = inner_ <= 2 ? rules.easy : inner_ <= 4 ? rules.easy * 2 / 3 : 1.0;
        if (inner_ >= 9) growth = 0.5;
        if (cautious_ > 0) {
          growth = growth < 1.5 ? growth : 1.5;
          --cautious_;
        }
        kappa_ = kappa_ * growth < rules.kappa_max ? kappa_ * growth : rules.kappa_max;
      }
      restart();
    } else if (inner_ >= most_inner) {
      fail();
    }
    if (!is_finite(scale_)) kappa_ = 0;
  }

  FCLIB_LANES void newton_step(bool mine) {
    const Group& group = system.group;
    // F and its slope at p
    double sums[1] = {0};
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = group.lane() + o * Group::size;
      if (a >= system.nc) break;
      double z[D], F[D], slope[D * D];
      argument(o, up_, z);
      sums[0] += law_[o].residual(p_[o], z, F);
      law_[o].slope(z, kappa_ * rho_[o], slope);
      system.put(a, F, slope);
    }
    group.sync();
    group.sum(sums);
    const double norm = square_root(sums[0]);
    if (inner_ == 0) first_ = norm;
    Vectors x{}, ux{};
    system.solve(x);
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (group.lane() + o * Group::size >= system.nc) break;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) x[o][k] += p_[o][k];
    }
    product(x, ux);
    // the whole step, or less of it
    double length = 0, trial = 0;
    for (int halving = 0;; ++halving) {
      trial = residual_norm(x, ux, length);
      const bool shorter = mine && !(trial < norm);
      if (halving == most_halvings || !group.anyone(shorter)) break;
      if (!shorter) continue;
      FCLIB_UNROLL
      for (int o = 0; o < Own; ++o) {
        FCLIB_UNROLL
        for (int k = 0; k < D; ++k) {
          x[o][k] = p_[o][k] + 0.5 * (x[o][k] - p_[o][k]);
          ux[o][k] = up_[o][k] + 0.5 * (ux[o][k] - up_[o][k]);
        }
      }
    }
    if (!mine) return;
    ++answer_.steps;
    ++inner_;
    if (!(trial < 10 * norm) || (trial >= norm && ++rises_ == 2)) {
      fail();
      return;
    }
    copy(x, p_);
    copy(ux, up_);
    // or as small as the rounding, multiplied by rho, allows
    const double rounding = 10 * machine_epsilon * kappa_ * length;
    if (trial <= larger(1e-2 * first_, rounding)) {
      state_ = State::solved;
      exact_ = trial <= 1e-15 * length;
    } else if (inner_ >= most_inner) {
      fail();
    }
  }

  FCLIB_LANES void fail() {
    kappa_ *= rules.hard;
    cautious_ = 3;
    restart();
  }

  FCLIB_LANES void copy(const Vectors& from, Vectors& to) const {
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (system.group.lane() + o * Group::size >= system.nc) break;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) to[o][k] = from[o][k];
    }
  }

  FCLIB_LANES void restart() {
    copy(r_, p_);
    copy(u_, up_);
    inner_ = rises_ = 0;
  }

  /// r_ is the iterate, with this error; it is kept if it is the best so far.
  FCLIB_LANES void accept(double error) {
    if (!(error < answer_.error) && answer_.error < FCLIB_INFINITY) return;
    answer_.error = error;
    answer_.ending = error <= rules.tolerance ? Ending::converged : Ending::unsolved;
    write();
  }

  FCLIB_LANES void write() const {
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      const int a = system.group.lane() + o * Group::size;
      if (a >= system.nc) break;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) {
        result_.r[D * a + k] = r_[o][k];
        result_.u[D * a + k] = u_[o][k];
      }
    }
  }

  /// y = W x + q
  FCLIB_LANES void product(const Vectors& x, Vectors& y) {
    system.product(x, y);
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (system.group.lane() + o * Group::size >= system.nc) break;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) y[o][k] += q_[o][k];
    }
  }

  /// z = r - rho u
  FCLIB_LANES void argument(int o, const Vectors& u, double* z) const {
    FCLIB_UNROLL
    for (int k = 0; k < D; ++k) z[k] = r_[o][k] - kappa_ * rho_[o] * u[o][k];
  }

  FCLIB_LANES double residual_norm(const Vectors& x, const Vectors& ux, double& length) const {
    double sums[2] = {0, 0};
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (system.group.lane() + o * Group::size >= system.nc) break;
      double z[D], F[D];
      argument(o, ux, z);
      sums[0] += law_[o].residual(x[o], z, F);
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) sums[1] += x[o][k] * x[o][k];
    }
    system.group.sum(sums);
    length = square_root(sums[1]);
    return square_root(sums[0]);
  }

  FCLIB_LANES static double length_of(const double* x) {
    double sum = 0;
    FCLIB_UNROLL
    for (int k = 0; k < D; ++k) sum += x[k] * x[k];
    return square_root(sum);
  }

  /// Merit::error of x, u = W x + q, and how far the velocity of p is from u.
  FCLIB_LANES double judge(const Vectors& x, const Vectors& u, double& gap) const {
    // ||W_ab r_b|| is at most the root of D^2 / (rho_a rho_b) times ||r_b||, if W is a Gram matrix
    double push[1] = {0};
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (system.group.lane() + o * Group::size >= system.nc) break;
      push[0] += D * length_of(x[o]) / square_root(rho_[o]);
    }
    system.group.sum(push);
    double sums[4] = {0, 0, 0, 0};  // plain, impulses, velocities, gap
    double lost[2] = {0, 0};        // by rounding, as velocities and as impulses
    FCLIB_UNROLL
    for (int o = 0; o < Own; ++o) {
      if (system.group.lane() + o * Group::size >= system.nc) break;
      double square = 0;
      FCLIB_UNROLL
      for (int k = 0; k < D; ++k) {
        square += q_[o][k] * q_[o][k];
        sums[3] += (up_[o][k] - u[o][k]) * (up_[o][k] - u[o][k]);
      }
      const double slip = rounding_of_q * larger(square_root(square), mean_);
      double limits = 1;
      FCLIB_UNROLL
      for (int g = 0; g < Law::groups; ++g) limits += law_[o].limit[g];
      const double speed = square_root(square) + push[0] / square_root(rho_[o]);
      const double size = length_of(x[o]);
      lost[0] += limits * (speed + larger(size, size / rho_[o]));
      lost[1] += limits * (rho_[o] * speed + size);
      sums[0] += law_[o].natural_square(u[o], x[o], 1.0, slip);
      const double scaled = law_[o].natural_square(u[o], x[o], rho_[o], slip);
      sums[1] += scaled;
      sums[2] += larger(scaled / (rho_[o] * rho_[o]), u[o][0] < 0 ? u[o][0] * u[o][0] : 0.0);
    }
    system.group.sum(lost);
    system.group.sum(sums);
    gap = square_root(sums[3]) * scale_;
    // a NaN in any of them is no small error
    if (!is_finite(sums[0] + sums[1] + sums[2] + scale_)) return FCLIB_INFINITY;
    const double plain = square_root(larger(sums[0], sums[2])) * scale_;
    const double error = larger(plain, square_root(sums[1]) * scaled_scale_);
    // what rounding may hide counts if the tolerance would notice
    const double hidden =
        machine_epsilon * (D * system.nc + 40) * larger(lost[0] * scale_, lost[1] * scaled_scale_);
    return hidden <= 1e-3 * rules.tolerance ? error : error + hidden;
  }

  Law law_[Own];
  double rho_[Own];
  double q_[Own][D];
  double r_[Own][D], u_[Own][D];   // the last proximal step
  double p_[Own][D], up_[Own][D];  // the last Newton step
  double kappa_ = 1, first_ = 0, mean_ = 0, scale_ = 1, scaled_scale_ = 1;
  int inner_ = 0, rises_ = 0, cautious_ = 0;
  bool exact_ = false;
  State state_ = State::begun;
  Answer answer_;
  Result result_;
};

}  // namespace fclib::proximal_small
