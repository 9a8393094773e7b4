// A group of lanes whose lanes are threads of the host: what lanes of a GPU would do wrong with shared
// memory, ThreadSanitizer sees here.
#pragma once

#include <array>
#include <atomic>
#include <barrier>
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

}  // namespace fclib::testing
