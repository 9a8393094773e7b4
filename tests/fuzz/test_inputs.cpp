// The fuzz targets over their seeds, over texts with changed bytes, and over the inputs in found/,
// each of which once made the library do wrong.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "fuzz.hpp"

namespace fclib::fuzz {
namespace {

class Fuzz : public ::testing::TestWithParam<const Target*> {};

TEST_P(Fuzz, Seeds) {
  const auto seeds = GetParam()->seeds();
  EXPECT_GT(seeds.size(), 10U);
  for (const auto& seed : seeds) {
    SCOPED_TRACE(seed.name);
    GetParam()->run(seed.bytes);
  }
}

TEST_P(Fuzz, WhatWasFoundBefore) {
  const auto folder = std::filesystem::path(FCLIB_FUZZ_FOUND) / GetParam()->name;
  if (!std::filesystem::exists(folder)) return;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    SCOPED_TRACE(entry.path().string());
    std::ifstream stream(entry.path(), std::ios::binary);
    GetParam()->run(std::string(std::istreambuf_iterator<char>(stream), {}));
  }
}

INSTANTIATE_TEST_SUITE_P(Targets, Fuzz, ::testing::ValuesIn(targets),
                         [](const auto& info) { return std::string(info.param->name); });

TEST(Fuzz, ChangedTexts) {
  std::uint32_t state = 1;
  const auto random = [&](std::size_t below) {
    state = state * 1664525 + 1013904223;
    return (state >> 8) % below;
  };
  for (const auto& seed : siconos_text.seeds()) {
    for (int k = 0; k < 20; ++k) {
      std::string text = seed.bytes;
      text[random(text.size())] = "0123456789 \n-.e:x"[random(17)];
      if (k % 4 == 0) text.resize(random(text.size()));
      siconos_text.run(text);
    }
  }
}

}  // namespace
}  // namespace fclib::fuzz
