#include "embed/batch.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "embed/batch_ways.hpp"
#include "linalg/workers.hpp"
#include "solve/driver.hpp"

namespace fclib {

namespace {

using batch::One;

/// The number of problems that a thread takes at once.
constexpr std::int64_t chunk = 32;
constexpr double poll_interval = 0.1;  // [s]

/// The position of a problem in each array.
struct Place {
  std::int64_t W = 0;
  std::int64_t q = 0;
  std::int64_t mu = 0;
  std::int64_t starts = 0;
  std::int64_t columns = 0;
  std::int64_t M = 0;
  std::int64_t H = 0;
  std::int64_t f = 0;
};

template <class Way>
class Runner {
 public:
  Runner(const Batch& batch, const BatchSettings& settings)
      : batch_(batch), settings_(settings), d_(batch.spacedim), deadline_(settings.time_limit) {
    if (!varies()) return;
    Place place;
    starts_.reserve(static_cast<std::size_t>(batch.count / chunk + 1));
    for (std::int64_t k = 0; k < batch.count; ++k) {
      if (k % chunk == 0) starts_.push_back(place);
      advance(place, k);
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
    return outcome_;
  }

 private:
  /// Whether problems differ in size.
  [[nodiscard]] bool varies() const {
    return batch_.nc != nullptr || (batch_.M != nullptr && batch_.n != nullptr) ||
           (batch_.starts != nullptr && !batch_.one_pattern);
  }

  [[nodiscard]] Index contacts(std::int64_t k) const {
    return batch_.nc == nullptr ? batch_.nc_each : batch_.nc[k];
  }
  [[nodiscard]] Index freedoms(std::int64_t k) const {
    if (batch_.M == nullptr) return 0;
    return batch_.n == nullptr ? batch_.n_each : batch_.n[k];
  }

  /// From problem k to the next.
  void advance(Place& place, std::int64_t k) const {
    const std::int64_t nc = contacts(k);
    const std::int64_t n = freedoms(k);
    const std::int64_t m = d_ * nc;
    if (batch_.starts == nullptr) {
      place.W += m * m;
    } else {
      const std::int64_t blocks = batch_.starts[place.starts + nc];
      place.W += d_ * d_ * blocks;
      if (!batch_.one_pattern) {
        place.starts += nc + 1;
        place.columns += blocks;
      }
    }
    place.q += m;
    place.mu += nc;
    place.M += n * n;
    place.H += n * m;
    place.f += n;
  }

  [[nodiscard]] One one(std::int64_t k, const Place& place) const {
    const auto at = [](auto* array, std::int64_t by) {
      return array == nullptr ? nullptr : array + by;
    };
    One result{};
    result.spacedim = d_;
    result.coupled = batch_.coupled;
    result.nc = contacts(k);
    result.n = freedoms(k);
    result.W = at(batch_.W, place.W);
    result.q = at(batch_.q, place.q);
    if (batch_.starts != nullptr) {
      result.blocks = {batch_.starts + place.starts, at(batch_.columns, place.columns), result.W};
    }
    result.M = at(batch_.M, place.M);
    result.H = at(batch_.H, place.H);
    result.f = at(batch_.f, place.f);
    result.w = at(batch_.w, place.q);
    result.mu = at(batch_.mu, place.mu);
    result.mu_r = at(batch_.mu_r, place.mu);
    result.mu_s = at(batch_.mu_s, place.mu);
    result.guess = at(batch_.guess, place.q);
    result.r = at(batch_.r, place.q);
    result.u = at(batch_.u, place.q);
    result.v = at(batch_.v, place.f);
    return result;
  }

  /// One thread: takes chunks as long as there are some.
  void work(bool polls) {
    // each thread keeps this memory: a caller with one problem at a time allocates nothing either
    thread_local Way kept;
    thread_local bool taken = false;
    // a caller's poll may begin a batch of its own
    std::optional<Way> own;
    Way& memory = taken ? own.emplace() : kept;
    const bool before = std::exchange(taken, true);
    struct Free {
      bool& taken;
      bool before;
      ~Free() { taken = before; }
    } const free{taken, before};
    BatchOutcome outcome;
    if (polls && settings_.poll) last_poll_ = now({});
    for (;;) {
      const std::int64_t first = next_.fetch_add(chunk, std::memory_order_relaxed);
      if (first >= batch_.count) break;
      go_on(polls);
      Place place;
      if (varies()) {
        place = starts_[static_cast<std::size_t>(first / chunk)];
      } else if (first > 0) {
        advance(place, 0);  // the sizes of one
        for (std::int64_t Place::* member :
             {&Place::W, &Place::q, &Place::mu, &Place::M, &Place::H, &Place::f}) {
          place.*member *= first;
        }
      }
      const std::int64_t last = std::min(first + chunk, batch_.count);
      if constexpr (Way::has_lanes) {
        if (in_lanes()) {
          solve_in_lanes(first, last, place, memory, polls, outcome);
          continue;
        }
      }
      for (std::int64_t k = first; k < last; ++k) {
        solve_one(k, place, memory, polls, outcome);
        advance(place, k);
      }
    }
    const std::lock_guard lock(mutex_);
    outcome_.converged += outcome.converged;
    outcome_.by_auto += outcome.by_auto;
    outcome_.invalid += outcome.invalid;
    if (outcome.invalid > 0 &&
        (outcome_.first_invalid < 0 || outcome.first_invalid < outcome_.first_invalid)) {
      outcome_.first_invalid = outcome.first_invalid;
      outcome_.wrong = std::move(outcome.wrong);
    }
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

  void write(std::int64_t k, Status status, double error, std::int64_t iterations,
             BatchOutcome& outcome) const {
    const auto number = static_cast<std::int32_t>(status);
    if (batch_.status != nullptr) {
      batch_.status[k] = batch_.codes != nullptr ? batch_.codes[number] : number;
    }
    if (batch_.error != nullptr) batch_.error[k] = error;
    if (batch_.iterations != nullptr) {
      constexpr std::int64_t most = std::numeric_limits<std::int32_t>::max();
      batch_.iterations[k] = static_cast<std::int32_t>(std::min(iterations, most));
    }
    outcome.converged += status == Status::converged ? 1 : 0;
  }

  /// The same of contacts without others that are solved, from `first` on.
  void write_solved(std::int64_t first, int count, const Alone& found,
                    BatchOutcome& outcome) const {
    constexpr auto number = static_cast<std::int32_t>(Status::converged);
    const std::int32_t status = batch_.codes != nullptr ? batch_.codes[number] : number;
    if (batch_.status != nullptr) std::fill_n(batch_.status + first, count, status);
    if (batch_.error != nullptr) std::copy_n(found.error.data(), count, batch_.error + first);
    if (batch_.iterations != nullptr) {
      std::copy_n(found.steps.data(), count, batch_.iterations + first);
    }
    outcome.converged += count;
  }

  /// Whether each problem has a lane: they have the same few contacts, and W is dense.
  [[nodiscard]] bool in_lanes() const {
    return !varies() && batch_.M == nullptr && batch_.starts == nullptr && batch_.nc_each > 0 &&
           batch_.nc_each <= Lanes<3>::most_contacts &&
           stopped_.load(std::memory_order_relaxed) < 0;
  }

  /// Problems `first` to `last`; `place` is that of the first.
  void solve_in_lanes(std::int64_t first, std::int64_t last, const Place& place, Way& way,
                      bool polls, BatchOutcome& outcome) {
    const std::int64_t m = std::int64_t{d_} * batch_.nc_each;
    const auto from = [&](std::int64_t k) {
      Place result = place;
      result.W += k * m * m;
      result.q += k * m;
      result.mu += k * batch_.nc_each;
      return result;
    };
    const auto arrays = [&](const Place& at) {
      const auto start = [&](auto* array) { return array == nullptr ? nullptr : array + at.q; };
      return LocalArrays{batch_.W + at.W,     batch_.q + at.q, batch_.mu + at.mu,
                         start(batch_.guess), batch_.r + at.q, start(batch_.u)};
    };
    const auto answered = [&](std::int64_t k, const auto& answer) {
      if (answer.solved) {
        write(first + k, Status::converged, answer.error, answer.sweeps, outcome);
      } else {
        solve_one(first + k, from(k), way, polls, outcome, answer);
      }
    };
    if (batch_.nc_each > 1) {
      way.lanes().solve(settings_.tolerance, batch_.nc_each, last - first, arrays(place), answered);
      return;
    }
    static_assert(chunk <= Alone::most);
    const int count = static_cast<int>(last - first);
    Alone found;
    Way::solve_alone(settings_.tolerance, count, arrays(place), found);
    if (found.solved == (std::uint64_t{1} << count) - 1) {
      write_solved(first, count, found, outcome);
      return;
    }
    for (int k = 0; k < count; ++k) {
      const auto at = static_cast<unsigned>(k);
      if ((found.solved >> at & 1U) != 0) {
        write(first + k, Status::converged, found.error[at], found.steps[at], outcome);
      } else {
        solve_one(first + k, from(k), way, polls, outcome);
      }
    }
  }

  /// `start` is what Lanes have begun.
  void solve_one(std::int64_t k, const Place& place, Way& way, bool polls, BatchOutcome& outcome,
                 const SweptStart& start = {}) {
    try {
      solve_one(k, one(k, place), way, polls, outcome, start);
    } catch (...) {
      fail(k, std::current_exception());
    }
  }

  void solve_one(std::int64_t k, const One& one, Way& way, bool polls, BatchOutcome& outcome,
                 const SweptStart& start) {
    const Index m = d_ * one.nc;
    const auto answer = [&](Status status, double error, std::int64_t iterations) {
      write(k, status, error, iterations, outcome);
    };
    if (std::string wrong = way.take(one); !wrong.empty()) {
      constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
      std::fill_n(one.r, m, nothing);
      if (one.u != nullptr) std::fill_n(one.u, m, nothing);
      if (one.v != nullptr) std::fill_n(one.v, one.n, nothing);
      answer(Status::invalid, std::numeric_limits<double>::infinity(), 0);
      if (outcome.invalid++ == 0) {  // chunks come in order
        outcome.first_invalid = k;
        outcome.wrong = std::move(wrong);
      }
      return;
    }
    if (start.started) {
      way.start_behind(start);
    } else if (one.guess != nullptr) {
      std::copy_n(one.guess, m, one.r);
    } else {
      std::fill_n(one.r, m, 0.0);
    }
    if (const int why = stopped_.load(std::memory_order_relaxed); why >= 0) {
      const double error = way.judge(one);
      answer(error <= settings_.tolerance ? Status::converged : static_cast<Status>(why), error, 0);
      return;
    }
    if (const auto solved = way.solve(one, settings_.tolerance)) {
      answer(Status::converged, solved->first, solved->second);
      return;
    }
    ++outcome.by_auto;
    const Result result =
        way.with_problem(one, [&](const auto& problem) { return by_auto(one, problem, polls); });
    std::copy_n(result.solution.r.data(), m, one.r);
    if (one.u != nullptr) std::copy_n(result.solution.u.data(), m, one.u);
    if (one.v != nullptr) std::copy_n(result.solution.v.data(), one.n, one.v);
    Status status = result.status;
    if (status == Status::interrupted) {  // by go_on(), which knows why
      const int why = stopped_.load(std::memory_order_relaxed);
      if (why >= 0) status = static_cast<Status>(why);
    }
    answer(status, result.error, result.iterations);
  }

  template <class Problem>
  [[nodiscard]] Result by_auto(const One& one, const Problem& problem, bool polls) {
    Solution guess;
    if (one.guess != nullptr) {
      guess.r = Eigen::Map<const Vector>(one.guess, d_ * one.nc);
    }
    Settings settings;
    settings.tolerance = settings_.tolerance;
    settings.time_limit = deadline_.left();
    settings.callback = [this, polls](const Progress&) { return go_on(polls); };
    static const Solver& whole_way = find_solver("auto");
    return solve(problem, whole_way, settings, {}, guess);
  }

  const Batch& batch_;
  const BatchSettings& settings_;
  const Index d_;
  Deadline deadline_;
  std::vector<Place> starts_;  // of each chunk, if the sizes vary
  std::atomic<std::int64_t> next_ = 0;
  std::atomic<int> stopped_ = -1;
  double last_poll_ = 0;  // of the thread that polls
  std::mutex mutex_;
  BatchOutcome outcome_;
  std::exception_ptr failure_;
  std::int64_t failed_ = 0;
};

[[noreturn]] void refuse(const char* where, const std::string& message) {
  throw Error(ErrorKind::problem, message, where);
}

/// The starts say where the next problem begins: all of them must make sense.
void check_starts(const Batch& batch) {
  if (batch.one_pattern && batch.nc != nullptr) {
    refuse("one_pattern", "is true, but problems have different numbers of contacts");
  }
  const std::int32_t* starts = batch.starts;
  const std::int64_t patterns =
      batch.one_pattern ? std::min<std::int64_t>(batch.count, 1) : batch.count;
  for (std::int64_t k = 0; k < patterns; ++k) {
    const Index nc = batch.nc == nullptr ? batch.nc_each : batch.nc[k];
    bool good = starts[0] == 0;
    for (Index a = 0; a < nc && good; ++a) good = starts[a] <= starts[a + 1];
    if (!good) {
      refuse("starts", "problem " + std::to_string(k) + " does not begin with 0, or goes down");
    }
    starts += nc + 1;
  }
}

/// The coefficients of friction say how many components a contact has.
void check_law(const Batch& batch) {
  const bool spin = batch.mu_s != nullptr;
  const bool rolling = batch.mu_r != nullptr;
  const auto [least, most] = spin ? std::pair(rolling ? 6 : 4, rolling ? 6 : 4)
                                  : std::pair(rolling ? 3 : 2, rolling ? 5 : 3);
  if (batch.spacedim != least && batch.spacedim != most) {
    refuse("spacedim", "is " + std::to_string(batch.spacedim) + ", expected " +
                           std::to_string(least) +
                           (least == most ? "" : " or " + std::to_string(most)) +
                           (spin ? " with mu_s" : "") + (rolling ? " with mu_r" : ""));
  }
  if (batch.coupled && (!spin || rolling)) {
    refuse("coupled", "is true, and only spacedim 4 has an ellipsoid of sliding and spin");
  }
}

}  // namespace

BatchOutcome solve_batch(const Batch& batch, const BatchSettings& settings) {
  check_law(batch);
  if (batch.count < 0) refuse("count", "is negative");
  check_tolerance(settings.tolerance);
  if (settings.threads < 0) throw Error(ErrorKind::option, "is negative", "threads");
  // a dense matrix of the core counts its entries by 32 bits
  constexpr std::int32_t most = 15000;
  const auto check = [&](const char* where, std::int32_t size, std::int64_t k) {
    if (size >= 0 && size <= most) return;
    refuse(where, "problem " + std::to_string(k) + " has " + std::to_string(size) +
                      ", expected 0 to " + std::to_string(most));
  };
  const auto check_all = [&](const char* where, const std::int32_t* sizes, std::int32_t each) {
    if (sizes == nullptr) check(where, each, 0);
    for (std::int64_t k = 0; sizes != nullptr && k < batch.count; ++k) check(where, sizes[k], k);
  };
  check_all("nc", batch.nc, batch.nc_each);
  if (batch.M != nullptr) check_all("n", batch.n, batch.n_each);
  if (batch.starts != nullptr) check_starts(batch);
  if (batch.mu_s != nullptr || batch.mu_r != nullptr) {
    return Runner<batch::WholeWay>(batch, settings).run();
  }
  if (batch.spacedim == 2) return Runner<batch::SmallWay<2>>(batch, settings).run();
  return Runner<batch::SmallWay<3>>(batch, settings).run();
}

}  // namespace fclib
