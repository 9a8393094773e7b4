// Parts of a computation on threads of their own.
#pragma once

#include <ctime>
#include <future>
#include <vector>

namespace fclib {

/// CPU time of the calling thread [s].
inline double thread_cpu_time() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Calls f(k) for k < count, f(0) on this thread, each other on one that ends with it; what one of
/// them throws is thrown here. Returns the CPU time of the others [s].
template <class F>
double on_threads(int count, const F& f) {
  std::vector<std::future<double>> others;
  for (int k = 1; k < count; ++k) {
    others.push_back(std::async(std::launch::async, [&f, k] {
      f(k);
      return thread_cpu_time();
    }));
  }
  f(0);
  double sum = 0;
  for (auto& other : others) sum += other.get();
  return sum;
}

}  // namespace fclib
