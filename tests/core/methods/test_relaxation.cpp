#include "methods/relaxation.hpp"

#include <gtest/gtest.h>

namespace fclib {
namespace {

TEST(Relaxation, StaysWhileTheErrorFalls) {
  Relaxation relaxation(0.8);
  for (int k = 0; k < 1000; ++k) EXPECT_EQ(relaxation.next(1.0 / (k + 1)), 0.8);
}

TEST(Relaxation, IsHalvedWhereTheErrorHasNoNewLeast) {
  Relaxation relaxation(1.0);
  relaxation.next(1.0);
  for (int k = 1; k < 50; ++k) EXPECT_EQ(relaxation.next(k % 2 ? 3.0 : 1.0), 1.0);
  EXPECT_EQ(relaxation.next(2.0), 0.5);
  EXPECT_EQ(relaxation.next(0.5), 0.5);  // a new least: fifty steps more
  for (int k = 1; k < 50; ++k) EXPECT_EQ(relaxation.next(0.5), 0.5);
  EXPECT_EQ(relaxation.next(0.5), 0.25);
}

TEST(Relaxation, EndsAtAnEighth) {
  Relaxation relaxation(1.0);
  double share = 1.0;
  for (int k = 0; k < 1000; ++k) share = relaxation.next(1.0);
  EXPECT_EQ(share, 0.125);
}

}  // namespace
}  // namespace fclib
