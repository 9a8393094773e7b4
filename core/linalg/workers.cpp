#include "linalg/workers.hpp"

#include <algorithm>
#include <cstddef>
#include <exception>

#include "linalg/cpu_time.hpp"

namespace fclib {

namespace {

// the other threads arrive soon: sleeping and waking takes longer than most waits
constexpr int looks = 1000;
constexpr int yields = 100;

}  // namespace

Workers::Workers(int count) : cpu_(static_cast<std::size_t>(std::max(count, 1)), 0.0) {
  threads_.reserve(cpu_.size());
  try {
    for (int k = 1; k < count; ++k) threads_.emplace_back([this, k] { serve(k); });
  } catch (const std::exception&) {
    // the work is shared among the threads that started
  }
  complete_.store(true, std::memory_order_release);
  complete_.notify_all();
}

Workers::~Workers() {
  job_ = nullptr;
  wait();
  for (std::thread& thread : threads_) thread.join();
}

void Workers::run(FunctionRef<void(int)> job) {
  job_ = &job;
  wait();
  job(0);
  wait();
}

void Workers::run_tasks(int count, FunctionRef<void(int)> task) {
  std::vector<std::exception_ptr> failures(cpu_.size());
  run([&](int worker) {
    try {
      for (int k = worker; k < count; k += this->count()) task(k);
    } catch (...) {
      failures[static_cast<std::size_t>(worker)] = std::current_exception();
    }
  });
  for (const std::exception_ptr& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
}

void Workers::wait() {
  const unsigned now = phase_.load(std::memory_order_acquire);
  if (arrived_.fetch_add(1, std::memory_order_acq_rel) + 1 == count()) {
    arrived_.store(0, std::memory_order_relaxed);
    phase_.store(now + 1, std::memory_order_release);
    phase_.notify_all();
    return;
  }
  for (int look = 0; look < looks + yields; ++look) {
    if (phase_.load(std::memory_order_acquire) != now) return;
    if (look >= looks) std::this_thread::yield();
  }
  phase_.wait(now, std::memory_order_acquire);
}

double Workers::cpu_s() const {
  double sum = 0;
  for (const double time : cpu_) sum += time;
  return sum;
}

void Workers::serve(int k) {
  complete_.wait(false, std::memory_order_acquire);
  for (;;) {
    wait();
    if (job_ == nullptr) return;
    (*job_)(k);
    cpu_[static_cast<std::size_t>(k)] = cpu_time();
    wait();
  }
}

}  // namespace fclib
