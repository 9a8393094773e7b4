#include "linalg/memory.hpp"

#include <gtest/gtest.h>

namespace fclib {
namespace {

TEST(Memory, is_known_on_linux) {
  const double bytes = available_memory();
  EXPECT_GT(bytes, 1e6);
#ifdef __linux__
  EXPECT_LT(bytes, 1e15);
#endif
}

}  // namespace
}  // namespace fclib
