// Threads that do the same job at once, each its own share of it.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <thread>
#include <vector>

#include "linalg/cpu_time.hpp"

namespace fclib {

class Workers {
 public:
  /// `count` of them, the calling thread being number 0. Fewer where the system gives no more.
  explicit Workers(int count) : cpu_(static_cast<std::size_t>(std::max(count, 1)), 0.0) {
    threads_.reserve(cpu_.size());
    try {
      for (int k = 1; k < count; ++k) threads_.emplace_back([this, k] { serve(k); });
    } catch (const std::exception&) {
      // the work is shared out among those that there are
    }
    complete_.store(true, std::memory_order_release);
    complete_.notify_all();
  }
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;
  ~Workers() {
    job_ = nullptr;
    wait();
    for (std::thread& thread : threads_) thread.join();
  }

  [[nodiscard]] int count() const { return static_cast<int>(threads_.size()) + 1; }

  /// Calls job(k) as each worker k, and returns when all have ended. A job must not throw; it may
  /// `wait` for the others, the same number of times on each worker.
  template <class Job>
  void run(const Job& job) {
    argument_ = &job;
    job_ = [](const void* argument, int k) { (*static_cast<const Job*>(argument))(k); };
    wait();
    job(0);
    wait();
  }

  /// Returns when all workers have come here.
  void wait() {
    const unsigned now = phase_.load(std::memory_order_acquire);
    if (arrived_.fetch_add(1, std::memory_order_acq_rel) + 1 == count()) {
      arrived_.store(0, std::memory_order_relaxed);
      phase_.store(now + 1, std::memory_order_release);
      phase_.notify_all();
      return;
    }
    // others are near: to sleep and to be woken takes longer than most waits
    for (int look = 0; look < looks + yields; ++look) {
      if (phase_.load(std::memory_order_acquire) != now) return;
      if (look >= looks) std::this_thread::yield();
    }
    phase_.wait(now, std::memory_order_acquire);
  }

  /// CPU time of the threads that it started [s].
  [[nodiscard]] double cpu_s() const {
    double sum = 0;
    for (const double time : cpu_) sum += time;
    return sum;
  }

 private:
  static constexpr int looks = 1000;
  static constexpr int yields = 100;

  void serve(int k) {
    complete_.wait(false, std::memory_order_acquire);
    for (;;) {
      wait();
      if (job_ == nullptr) return;
      job_(argument_, k);
      cpu_[static_cast<std::size_t>(k)] = cpu_time();
      wait();
    }
  }

  std::atomic<bool> complete_ = false;  // all threads are there
  std::atomic<unsigned> phase_ = 0;
  std::atomic<int> arrived_ = 0;
  const void* argument_ = nullptr;
  void (*job_)(const void*, int) = nullptr;
  std::vector<double> cpu_;
  std::vector<std::thread> threads_;
};

}  // namespace fclib
