// A group of lanes whose lanes are threads of the host: what lanes of a GPU would do wrong with
// shared memory, ThreadSanitizer sees here.
#pragma once

#include <algorithm>
#include <array>
#include <barrier>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <vector>

namespace fclib::testing {

template <int N>
struct Team {
  static constexpr int size = N;

  struct Common {
    std::barrier<> barrier{N};
    std::array<std::array<double, 4>, N> sums{};
  };

  Common* common = nullptr;
  int number = 0;

  [[nodiscard]] int lane() const { return number; }
  void sync() const { common->barrier.arrive_and_wait(); }
  template <int M>
  void sum(double (&x)[M]) const {
    for (int k = 0; k < M; ++k) common->sums[number][k] = x[k];
    sync();
    for (int k = 0; k < M; ++k) {
      x[k] = 0;
      for (int lane = 0; lane < N; ++lane) x[k] += common->sums[lane][k];
    }
    sync();
  }
  [[nodiscard]] bool anyone(bool x) const { return x; }
  [[nodiscard]] int most(int n) const { return n; }

  /// Calls work(team) in N threads at once.
  template <class Work>
  static void run(const Work& work) {
    Common common;
    std::vector<std::thread> threads;
    for (int k = 0; k < N; ++k) {
      threads.emplace_back([&common, &work, k] {
        Team team;
        team.common = &common;
        team.number = k;
        work(team);
      });
    }
    for (std::thread& thread : threads) thread.join();
  }
};

/// M groups of N lanes that run in step, as those of a warp: each call that a warp makes as a whole
/// must be made by all. A call that only some make is an error after a while, not a wait for ever.
template <int N, int M>
struct InStep {
  static constexpr int size = N;
  enum class Call { sync, sum, anyone, most };

  struct Common {
    std::mutex mutex;
    std::condition_variable changed;
    int arrived = 0, round = 0;
    bool broken = false;
    Call call = Call::sync;
    std::array<std::array<double, 4>, N * M> values{};
  };

  Common* common = nullptr;
  int number = 0;

  [[nodiscard]] int lane() const { return number % N; }
  void sync() const { meet(Call::sync); }
  template <int K>
  void sum(double (&x)[K]) const {
    for (int k = 0; k < K; ++k) common->values[number][k] = x[k];
    meet(Call::sum);
    const int first = number / N * N;
    for (int k = 0; k < K; ++k) {
      x[k] = 0;
      for (int lane = first; lane < first + N; ++lane) x[k] += common->values[lane][k];
    }
    meet(Call::sum);
  }
  [[nodiscard]] bool anyone(bool x) const { return largest(x ? 1 : 0, Call::anyone) > 0; }
  [[nodiscard]] int most(int n) const { return static_cast<int>(largest(n, Call::most)); }

  /// Calls work(group, its number) in N M threads. Throws if they did not make the same calls.
  template <class Work>
  static void run(const Work& work) {
    Common common;
    std::vector<std::thread> threads;
    for (int k = 0; k < N * M; ++k) {
      threads.emplace_back([&common, &work, k] {
        InStep group;
        group.common = &common;
        group.number = k;
        try {
          work(group, k / N);
        } catch (const std::logic_error&) {
          // it is common.broken
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    if (common.broken) throw std::logic_error("some lanes made a call that others did not make");
  }

 private:
  void meet(Call call) const {
    std::unique_lock lock(common->mutex);
    if (common->arrived == 0) common->call = call;
    if (common->call != call) common->broken = true;
    const int round = common->round;
    if (++common->arrived == N * M) {
      common->arrived = 0;
      ++common->round;
      common->changed.notify_all();
    } else {
      const auto over = [&] { return common->round != round || common->broken; };
      if (!common->changed.wait_for(lock, std::chrono::seconds(20), over)) common->broken = true;
    }
    if (!common->broken) return;
    common->changed.notify_all();
    throw std::logic_error("out of step");
  }
  [[nodiscard]] double largest(double x, Call call) const {
    common->values[number][0] = x;
    meet(call);
    double most = common->values[0][0];
    for (const auto& value : common->values) most = std::max(most, value[0]);
    meet(call);
    return most;
  }
};

}  // namespace fclib::testing
