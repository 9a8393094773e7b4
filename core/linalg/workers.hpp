// Threads that do the same job at once, each its own share of it. The core has no other mechanism
// for threads.
#pragma once

#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

#include "function_ref.hpp"

namespace fclib {

class Workers {
 public:
  /// `count` workers; the calling thread is number 0. There are fewer if the system gives no more.
  explicit Workers(int count);
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;
  ~Workers();

  [[nodiscard]] int count() const { return static_cast<int>(threads_.size()) + 1; }

  /// Calls job(k) as each worker k, and returns when all have ended. A job must not throw. It may
  /// `wait` for the others, the same number of times on each worker.
  void run(FunctionRef<void(int)> job);

  /// Calls task(k) for k < count, one after another on each worker: worker w has w, w + count(),
  /// ... The first exception of a task is thrown here when all have ended.
  void run_tasks(int count, FunctionRef<void(int)> task);

  /// Returns when all workers have come here.
  void wait();

  /// CPU time of the threads that it started [s].
  [[nodiscard]] double cpu_s() const;

 private:
  void serve(int k);

  std::atomic<bool> complete_ = false;  // all threads are there
  std::atomic<unsigned> phase_ = 0;
  std::atomic<int> arrived_ = 0;
  const FunctionRef<void(int)>* job_ = nullptr;
  std::vector<double> cpu_;
  std::vector<std::thread> threads_;
};

/// Calls f(first, last) for parts of 0..n, one on each worker. Without workers, there is one part.
template <class F>
void in_parts(Workers* workers, std::int64_t n, const F& f) {
  if (workers == nullptr) return f(std::int64_t{0}, n);
  const std::int64_t count = workers->count();
  workers->run([&](int k) { f(k * n / count, (k + 1) * n / count); });
}

}  // namespace fclib
