// Parts of a computation on threads of their own, which end with them.
#pragma once

#include <future>
#include <system_error>
#include <vector>

#include "linalg/cpu_time.hpp"

namespace fclib {

/// Calls f(k) for k < count, f(0) on this thread and each other on a new one, or here where the
/// system gives none. What one of them throws is thrown here. CPU time of the others [s].
template <class F>
double on_threads(int count, const F& f) {
  std::vector<std::future<double>> others;
  int started = 1;
  try {
    for (; started < count; ++started) {
      others.push_back(std::async(std::launch::async, [&f, k = started] {
        f(k);
        return cpu_time();
      }));
    }
  } catch (const std::system_error&) {
    // no thread is left
  }
  f(0);
  for (int k = started; k < count; ++k) f(k);
  double sum = 0;
  for (auto& other : others) sum += other.get();
  return sum;
}

}  // namespace fclib
