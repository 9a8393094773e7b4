#include "embed/batch.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "embed/small_solver.hpp"
#include "linalg/extended.hpp"
#include "linalg/workers.hpp"
#include "merit/natural_sums.hpp"
#include "solve/driver.hpp"

namespace fclib {

namespace {

/// The number of problems that a thread takes at once.
constexpr std::int64_t chunk = 32;
/// Larger ones are for `auto`: the small solver is dense, `auto` is not.
constexpr Index most_contacts = 64;
constexpr double poll_interval = 0.1;  // [s]

/// The position of a problem in each array.
struct Place {
  std::int64_t W = 0;
  std::int64_t q = 0;
  std::int64_t mu = 0;
};

struct One {
  Index nc;
  const double* W;
  const double* q;
  const double* mu;
  const double* guess;
  double* r;
  double* u;
};

bool all_finite(const double* x, std::int64_t size) {
  double sum = 0;  // zero, or NaN: without a branch
  for (std::int64_t k = 0; k < size; ++k) sum += x[k] * 0.0;
  return sum == 0;
}

/// u = W r + q, and the merit of r, both in extended precision.
template <int D>
double judge(const One& one) {
  using std::abs, std::sqrt;  // or those of Real
  using Vec = ContactVector<D, Real>;
  NaturalSums<Coulomb<D, Real>> sums;
  const auto m = static_cast<std::int64_t>(D) * one.nc;
  const auto size_of = [&](Index a) {
    Real size = 0;
    for (std::int64_t k = D * a; k < D * (a + 1); ++k) size += abs(Real(one.W[k * m + k])) / D;
    return size;
  };
  ContactScales<Real> scales;
  Real squares = 0;
  for (Index a = 0; a < one.nc; ++a) scales.add(size_of(a));
  for (std::int64_t k = 0; k < m; ++k) squares += full_product(one.q[k], one.q[k]);
  const Real mean = sqrt(squares / one.nc);
  for (Index a = 0; a < one.nc; ++a) {
    Vec u;
    Vec q;
    Vec r;
    for (int k = 0; k < D; ++k) {
      const std::int64_t at = D * a + k;
      const double* row = one.W + at * m;
      Real sum = 0;
      for (std::int64_t j = 0; j < m; ++j) sum += full_product(row[j], one.r[j]);
      sum += one.q[at];
      u[k] = sum;
      q[k] = one.q[at];
      r[k] = one.r[at];
      if (one.u != nullptr) one.u[at] = static_cast<double>(sum);
    }
    const Real rho = scales.rho(size_of(a));
    const Coulomb<D, Real> cone(one.mu[a]);
    const Real q_square = q.squaredNorm();
    const Real slip = slip_of_rounding<Real>(sqrt(q_square), mean);
    sums.add(cone, u, r, q_square, Real(0), rho, {slip});
  }
  return sums.error();
}

template <int D>
class Runner {
 public:
  Runner(const Batch& batch, const BatchSettings& settings)
      : batch_(batch), settings_(settings), deadline_(settings.time_limit) {
    if (batch.nc == nullptr) return;
    Place place;
    starts_.reserve(static_cast<std::size_t>((batch.count + chunk - 1) / chunk));
    for (std::int64_t k = 0; k < batch.count; ++k) {
      if (k % chunk == 0) starts_.push_back(place);
      advance(place, batch.nc[k]);
    }
  }

  BatchOutcome run() {
    const std::int64_t chunks = (batch_.count + chunk - 1) / chunk;
    int threads = settings_.threads;
    if (threads == 0) threads = static_cast<int>(std::thread::hardware_concurrency());
    threads =
        static_cast<int>(std::clamp<std::int64_t>(threads, 1, std::max<std::int64_t>(chunks, 1)));
    if (threads == 1) {
      work(true);
    } else {
      Workers workers(threads);
      workers.run([&](int worker) { work(worker == 0); });
    }
    if (failure_) std::rethrow_exception(failure_);
    return {converged_, by_auto_};
  }

 private:
  static void advance(Place& place, std::int64_t nc) {
    place.W += D * nc * D * nc;
    place.q += D * nc;
    place.mu += nc;
  }

  [[nodiscard]] Index contacts(std::int64_t k) const {
    return batch_.nc == nullptr ? batch_.nc_each : batch_.nc[k];
  }

  [[nodiscard]] One one(std::int64_t k, const Place& place) const {
    const auto or_null = [&](auto* array) { return array == nullptr ? nullptr : array + place.q; };
    return {contacts(k),           batch_.W + place.W, batch_.q + place.q, batch_.mu + place.mu,
            or_null(batch_.guess), batch_.r + place.q, or_null(batch_.u)};
  }

  /// One thread: takes chunks as long as there are some.
  void work(bool polls) {
    // each thread keeps this memory: a caller with one problem at a time allocates nothing either
    thread_local SmallSolver<D> solver;
    std::int64_t converged = 0;
    std::int64_t by_auto = 0;
    if (polls && settings_.poll) last_poll_ = now({});
    for (;;) {
      const std::int64_t first = next_.fetch_add(chunk, std::memory_order_relaxed);
      if (first >= batch_.count) break;
      go_on(polls);
      Place place;
      if (batch_.nc != nullptr) {
        place = starts_[static_cast<std::size_t>(first / chunk)];
      } else {
        const std::int64_t m = D * static_cast<std::int64_t>(batch_.nc_each);
        place = {first * m * m, first * m, first * batch_.nc_each};
      }
      const std::int64_t last = std::min(first + chunk, batch_.count);
      for (std::int64_t k = first; k < last; ++k) {
        try {
          solve_one(k, one(k, place), solver, polls, converged, by_auto);
        } catch (...) {
          fail(k, std::current_exception());
        }
        advance(place, contacts(k));
      }
    }
    const std::lock_guard lock(mutex_);
    converged_ += converged;
    by_auto_ += by_auto;
  }

  /// Whether nobody has stopped the batch. One of the threads asks the caller.
  bool go_on(bool polls) {
    if (polls && settings_.poll && now({}) - last_poll_ > poll_interval) {
      last_poll_ = now({});
      try {
        if (!settings_.poll()) stop(Status::interrupted);
      } catch (...) {
        fail(-1, std::current_exception());
        stop(Status::interrupted);
      }
    }
    if (deadline_.passed()) stop(Status::time_limit);
    return stopped_.load(std::memory_order_relaxed) < 0;
  }

  void stop(Status why) { stopped_.store(static_cast<int>(why), std::memory_order_relaxed); }

  void fail(std::int64_t k, const std::exception_ptr& failure) {
    const std::lock_guard lock(mutex_);
    if (failure_ && failed_ <= k) return;
    failure_ = failure;
    failed_ = k;
  }

  void check(std::int64_t k, const One& one) const {
    const auto bad = [&](const char* name, const std::string& what) {
      throw Error(ErrorKind::problem, what, "problem " + std::to_string(k) + ": " + name);
    };
    const std::int64_t m = D * static_cast<std::int64_t>(one.nc);
    if (!all_finite(one.W, m * m)) bad("W", "has an entry that is not finite");
    if (!all_finite(one.q, m)) bad("q", "has an entry that is not finite");
    for (Index a = 0; a < one.nc; ++a) {
      if (one.mu[a] >= 0 && std::isfinite(one.mu[a])) continue;
      bad("mu", "contact " + std::to_string(a) + " has " + std::to_string(one.mu[a]) +
                    ", expected a finite number that is not negative");
    }
    if (one.guess != nullptr && !all_finite(one.guess, m)) {
      bad("guess", "has an entry that is not finite");
    }
  }

  void solve_one(std::int64_t k, const One& one, SmallSolver<D>& solver, bool polls,
                 std::int64_t& converged, std::int64_t& by_auto) {
    const Index nc = one.nc;
    const Index m = D * nc;
    const auto answer = [&](Status status, double error, std::int64_t iterations) {
      const auto number = static_cast<std::int32_t>(status);
      if (batch_.status != nullptr) {
        batch_.status[k] = batch_.codes != nullptr ? batch_.codes[number] : number;
      }
      if (batch_.error != nullptr) batch_.error[k] = error;
      if (batch_.iterations != nullptr) {
        constexpr std::int64_t most = std::numeric_limits<std::int32_t>::max();
        batch_.iterations[k] = static_cast<std::int32_t>(std::min(iterations, most));
      }
      converged += status == Status::converged ? 1 : 0;
    };
    const auto begin = [&] {
      if (one.guess != nullptr) {
        std::copy_n(one.guess, m, one.r);
      } else {
        std::fill_n(one.r, m, 0.0);
      }
    };
    check(k, one);
    if (const int why = stopped_.load(std::memory_order_relaxed); why >= 0) {
      begin();
      const double error = judge<D>(one);
      answer(error <= settings_.tolerance ? Status::converged : static_cast<Status>(why), error, 0);
      return;
    }
    bool separating = true;
    for (Index a = 0; a < nc && separating; ++a) separating = one.q[D * a] >= 0;
    if (separating) {
      std::fill_n(one.r, m, 0.0);
      answer(Status::converged, judge<D>(one), 0);
      return;
    }
    if (nc <= most_contacts) {
      begin();
      solver.take(nc, one.W, one.q, one.mu);
      const double error = solver.solve(settings_.tolerance, one.r, [&] { return judge<D>(one); });
      if (error <= settings_.tolerance) {
        answer(Status::converged, error, solver.iterations());
        return;
      }
    }
    ++by_auto;
    const Result result = solve_by_auto(one, polls);
    std::copy_n(result.solution.r.data(), m, one.r);
    if (one.u != nullptr) std::copy_n(result.solution.u.data(), m, one.u);
    answer(result.status, result.error, result.iterations);
  }

  [[nodiscard]] Result solve_by_auto(const One& one, bool polls) {
    const Eigen::Index m = D * static_cast<Eigen::Index>(one.nc);
    LocalProblem problem;
    problem.spacedim = D;
    problem.mu = Eigen::Map<const Vector>(one.mu, one.nc);
    problem.q = Eigen::Map<const Vector>(one.q, m);
    problem.W.storage = Storage::dense;
    problem.W.rows = problem.W.cols = static_cast<Index>(m);
    problem.W.x.resize(static_cast<std::size_t>(m * m));
    Eigen::Map<Eigen::MatrixXd>(problem.W.x.data(), m, m) =
        Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
            one.W, m, m);
    Solution guess;
    if (one.guess != nullptr) guess.r = Eigen::Map<const Vector>(one.guess, m);
    Settings settings;
    settings.tolerance = settings_.tolerance;
    settings.time_limit = deadline_.left();
    settings.callback = [this, polls](const Progress&) { return go_on(polls); };
    static const Solver& whole_way = find_solver("auto");
    return solve(problem, whole_way, settings, {}, guess);
  }

  const Batch& batch_;
  const BatchSettings& settings_;
  Deadline deadline_;
  std::vector<Place> starts_;  // of each chunk, if the numbers of contacts vary
  std::atomic<std::int64_t> next_ = 0;
  std::atomic<int> stopped_ = -1;
  double last_poll_ = 0;  // of the thread that polls
  std::mutex mutex_;
  std::int64_t converged_ = 0;
  std::int64_t by_auto_ = 0;
  std::exception_ptr failure_;
  std::int64_t failed_ = 0;
};

[[noreturn]] void refuse(const char* where, const std::string& message) {
  throw Error(ErrorKind::problem, message, where);
}

}  // namespace

BatchOutcome solve_batch(const Batch& batch, const BatchSettings& settings) {
  if (batch.spacedim != 2 && batch.spacedim != 3) {
    refuse("spacedim", "is " + std::to_string(batch.spacedim) + ", expected 2 or 3");
  }
  if (batch.count < 0) refuse("count", "is negative");
  if (!(settings.tolerance >= 0)) {
    throw Error(ErrorKind::option, "is not a number that is not negative", "tolerance");
  }
  if (settings.threads < 0) throw Error(ErrorKind::option, "is negative", "threads");
  // a dense matrix of the core counts its entries by 32 bits
  constexpr std::int32_t most = 15000;
  const auto check_count = [&](std::int32_t nc, std::int64_t k) {
    if (nc >= 0 && nc <= most) return;
    refuse("nc", "problem " + std::to_string(k) + " has " + std::to_string(nc) +
                     ", expected 0 to " + std::to_string(most));
  };
  if (batch.nc == nullptr) check_count(batch.nc_each, 0);
  for (std::int64_t k = 0; batch.nc != nullptr && k < batch.count; ++k) check_count(batch.nc[k], k);
  if (batch.spacedim == 2) return Runner<2>(batch, settings).run();
  return Runner<3>(batch, settings).run();
}

}  // namespace fclib
