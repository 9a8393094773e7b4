// What stands in for the library's conversions of numbers does what the library's do.
#include "number_text.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace fclib {
namespace {

std::vector<double> numbers() {
  std::vector<double> result{0.0,
                             -0.0,
                             1.0,
                             0.1,
                             1e5,
                             100000.5,
                             1e-5,
                             1e20,
                             1e22,
                             1.5e23,
                             5e-324,
                             1e-310,
                             123456789012345680.0,
                             -2.5e-4,
                             std::numeric_limits<double>::max(),
                             std::numeric_limits<double>::infinity()};
  std::mt19937_64 random(1);
  for (int k = 0; k < 20000; ++k) {
    const auto value = std::bit_cast<double>(random());
    if (std::isfinite(value)) result.push_back(value);
    result.push_back(static_cast<double>(random() % 2000000) / 1000);
  }
  return result;
}

TEST(NumberText, IsTheShortestWithoutTheLibraryToo) {
  for (const double value : numbers()) {
    const std::string text = shortest(value);
    ASSERT_EQ(detail::shortest_by_trial(value), text);
    double back = 1;
    ASSERT_EQ(detail::read_by_strtod(text.data(), text.data() + text.size(), back).ec, std::errc());
    ASSERT_EQ(std::bit_cast<std::uint64_t>(back), std::bit_cast<std::uint64_t>(value)) << text;
  }
}

TEST(NumberText, IsReadInTheSameWayWithoutTheLibrary) {
  for (const std::string text :
       {"1",      "-1.5",   ".5",     "5.",   "1e3", "1e",    "1e+",      "1e-7x",   "+1",  " 1",
        "-",      ".",      "",       "0x10", "inf", "-INF",  "infinity", "infinit", "nan", "1e999",
        "-1e999", "1e-999", "0e-999", "0.0",  "1,5", "00012", "1.2.3",    "--1",     "e5"}) {
    double expected = 7;
    double found = 7;
    const char* const end = text.data() + text.size();
    const auto by_library = read_number(text.data(), end, expected);
    const auto own = detail::read_by_strtod(text.data(), end, found);
    EXPECT_EQ(own.ec, by_library.ec) << text;
    EXPECT_EQ(own.ptr - text.data(), by_library.ptr - text.data()) << text;
    EXPECT_TRUE(found == expected || (std::isnan(found) && std::isnan(expected))) << text;
  }
}

}  // namespace
}  // namespace fclib
