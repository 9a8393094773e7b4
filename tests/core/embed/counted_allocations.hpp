// How often the program asks for memory: the operators of C++ and Eigen's malloc, counted.
#pragma once

#include <atomic>

namespace fclib::testing {

/// Calls of malloc, of all threads, since the program began; -1 where they cannot be counted.
long allocations();

}  // namespace fclib::testing
