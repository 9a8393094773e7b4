// Bytes of a file in pieces, some of them lent.
#include "io/hdf5/memory_file.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

namespace fclib::hdf5 {
namespace {

std::string joined(const std::vector<std::string_view>& pieces) {
  std::string result;
  for (const std::string_view piece : pieces) result += piece;
  return result;
}

TEST(Pieces, AreWhatWasWrittenLast) {
  std::mt19937 random(1);
  const auto below = [&](std::size_t bound) { return random() % bound; };
  constexpr std::size_t size = 300'000;
  std::string lent(1'000'000, '\0');
  for (char& byte : lent) byte = static_cast<char>(random());
  for (int turn = 0; turn < 20; ++turn) {
    std::string expected(turn % 2 == 0 ? 0 : 50'000, 'a');
    Pieces pieces(expected);
    expected.resize(size);
    pieces.lend(lent.data(), lent.size());
    for (int k = 0; k < 60; ++k) {
      const std::size_t at = below(size);
      const std::size_t length = std::min(size - at, below(k % 3 == 0 ? 100'000 : 2'000));
      const char* from = lent.data() + below(lent.size() - length);
      // some of it is not lent
      const std::string own(from, length);
      pieces.write(at, k % 2 == 0 ? from : own.data(), length);
      std::copy_n(from, length, expected.begin() + static_cast<std::ptrdiff_t>(at));

      const std::size_t look = below(size);
      std::string seen(std::min(size - look, below(150'000)), 'x');
      pieces.read(look, seen.data(), seen.size());
      ASSERT_EQ(seen, expected.substr(look, seen.size()));
    }
    ASSERT_EQ(joined(pieces.all(size)), expected);
    ASSERT_EQ(joined(pieces.all(size / 2)), expected.substr(0, size / 2));
  }
}

TEST(Pieces, AreNotCopiedWhereTheyWereLent) {
  const std::string lent(100'000, 'b');
  Pieces pieces;
  pieces.lend(lent.data(), lent.size());
  pieces.write(10, lent.data(), lent.size());
  const auto all = pieces.all(lent.size() + 10);
  EXPECT_EQ(joined(all), std::string(10, '\0') + lent);
  EXPECT_EQ(all.back().data(), lent.data());
}

}  // namespace
}  // namespace fclib::hdf5
