#include "solve/options.hpp"

#include <gtest/gtest.h>

#include "error.hpp"

namespace fclib {
namespace {

enum class Mode { slow, fast };
constexpr std::array<std::string_view, 2> modes{"slow", "fast"};

struct Sample {
  Mode mode = Mode::slow;
  double step = 0.5;
  std::int64_t count = 3;
  bool verbose = false;

  static constexpr auto fields() {
    using O = Sample;
    return std::tuple{
        OptionField<O, Mode>{.name = "mode", .member = &O::mode, .choices = modes},
        OptionField<O, double>{.name = "step", .member = &O::step, .lowest = 0, .highest = 1},
        OptionField<O, std::int64_t>{.name = "count", .member = &O::count, .lowest = 1},
        OptionField<O, bool>{.name = "verbose", .member = &O::verbose},
    };
  }
};

TEST(Options, take_values_and_text) {
  const auto defaults = parse_options<Sample>({});
  EXPECT_EQ(defaults.mode, Mode::slow);
  EXPECT_EQ(defaults.step, 0.5);
  const auto typed = parse_options<Sample>({{"mode", std::string("fast")},
                                            {"step", 0.25},
                                            {"count", std::int64_t{7}},
                                            {"verbose", true}});
  const auto text = parse_options<Sample>({{"mode", std::string("fast")},
                                           {"step", std::string("0.25")},
                                           {"count", std::string("7")},
                                           {"verbose", std::string("true")}});
  for (const auto& options : {typed, text}) {
    EXPECT_EQ(options.mode, Mode::fast);
    EXPECT_EQ(options.step, 0.25);
    EXPECT_EQ(options.count, 7);
    EXPECT_TRUE(options.verbose);
  }
}

TEST(Options, refuse_what_they_do_not_know) {
  const OptionValues wrong[] = {
      {{"stepp", 0.5}},
      {{"step", std::string("half")}},
      {{"step", 2.0}},
      {{"step", std::string("nan")}},
      {{"count", 1.5}},
      {{"count", std::int64_t{0}}},
      {{"mode", std::string("faster")}},
      {{"verbose", std::string("maybe")}},
  };
  for (const auto& values : wrong) {
    EXPECT_THROW(parse_options<Sample>(values), Error) << values.begin()->first;
  }
}

TEST(Options, are_described_from_the_same_place) {
  const auto infos = describe_options<Sample>();
  ASSERT_EQ(infos.size(), 4U);
  EXPECT_EQ(infos[0].type, "choice");
  EXPECT_EQ(std::get<std::string>(infos[0].default_value), "slow");
  EXPECT_EQ(infos[0].choices.size(), 2U);
  EXPECT_EQ(infos[2].type, "int");
  EXPECT_EQ(std::get<std::int64_t>(infos[2].default_value), 3);
}

}  // namespace
}  // namespace fclib
