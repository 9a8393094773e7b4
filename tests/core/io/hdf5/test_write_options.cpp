#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "io/hdf5/hdf5.hpp"
#include "temporary_folder.hpp"

namespace fclib {
namespace {

namespace fs = std::filesystem;

Matrix diagonal(Index size, double value) {
  Matrix a;
  a.storage = Storage::dense;
  a.rows = a.cols = size;
  a.x.assign(static_cast<std::size_t>(size * size), 0);
  for (Index k = 0; k < size; ++k) a.x[static_cast<std::size_t>(k * size + k)] = value;
  return a;
}

LocalProblem local_problem(double value, Index contacts = 2) {
  LocalProblem problem;
  problem.W = diagonal(3 * contacts, value);
  problem.q = Vector::Constant(3 * contacts, value);
  problem.mu = Vector::Constant(contacts, 0.5);
  return problem;
}

GlobalProblem global_problem(double value) {
  GlobalProblem problem;
  problem.M = diagonal(6, value);
  problem.H = diagonal(6, 1);
  problem.f = Vector::Constant(6, value);
  problem.w = Vector::Zero(6);
  problem.mu = Vector::Constant(2, 0.5);
  return problem;
}

Solution local_solution(double value) {
  return {.v = {}, .u = Vector::Constant(6, value), .r = Vector::Constant(6, value), .l = {}};
}
Solution global_solution(double value) {
  Solution solution = local_solution(value);
  solution.v = Vector::Constant(6, value);
  return solution;
}

/// Files in a folder of its own.
class Writing : public ::testing::Test {
 protected:
  [[nodiscard]] std::string path(const char* name = "problem.hdf5") const {
    return (folder_.path() / name).string();
  }
  [[nodiscard]] std::string bytes() const {
    std::ifstream stream(path(), std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  [[nodiscard]] double local_value() const {
    return std::get<LocalProblem>(read_problem(path(), "local")).q[0];
  }
  [[nodiscard]] double global_value() const {
    return std::get<GlobalProblem>(read_problem(path(), "global")).f[0];
  }
  [[nodiscard]] std::vector<double> guess_values() const {
    std::vector<double> values;
    for (const auto& guess : read_guesses(path())) values.push_back(guess.r[0]);
    return values;
  }
  void write(const auto& problem, const WriteOptions& options, const Solution* solution = nullptr,
             const std::vector<Solution>& guesses = {}) const {
    write_file(path(), &problem, solution, guesses, options);
  }
  /// What the error of a write says; the file must be as it was.
  template <class Write>
  [[nodiscard]] std::string refusal(const Write& write) const {
    const std::string before = bytes();
    std::string message = "no error";
    try {
      write();
    } catch (const Error& error) {
      message = error.what();
    }
    EXPECT_EQ(bytes(), before) << message;
    return message;
  }
  static void expect_in(const std::string& part, const std::string& message) {
    EXPECT_NE(message.find(part), std::string::npos) << message;
  }

 private:
  testing::TemporaryFolder folder_;
};

using Values = std::vector<double>;

TEST_F(Writing, ReplacesTheFileWholeByDefault) {
  const Solution solution = local_solution(1);
  write(local_problem(1), {}, &solution, {solution});
  write(global_problem(2), {});
  const Contents contents = read_contents(path());
  EXPECT_EQ(contents.kinds, std::vector<std::string>{"global"});
  EXPECT_FALSE(contents.solution);
  EXPECT_EQ(contents.guesses, 0);
}

TEST_F(Writing, AppendKeepsWhatTheFileHolds) {
  write(local_problem(1), {.append = true});  // a file that is not there is made
  write(global_problem(2), {.append = true});
  EXPECT_EQ(read_contents(path()).kinds, (std::vector<std::string>{"global", "local"}));
  EXPECT_EQ(local_value(), 1);
  EXPECT_EQ(global_value(), 2);
  expect_in("/fclib_local: is in the file already",
            refusal([&] { write(local_problem(3), {.append = true}); }));
}

TEST_F(Writing, ReplaceTakesWhatBelongsToTheProblemAndNothingElse) {
  const WriteOptions append{.append = true};
  const WriteOptions replace{.append = true, .replace = true};
  const Solution solution = global_solution(2);
  write(local_problem(1), {});
  write(global_problem(2), append, &solution, {solution, solution});
  write(local_problem(3), replace);
  EXPECT_EQ(local_value(), 3);
  EXPECT_EQ(global_value(), 2);
  EXPECT_TRUE(read_solution(path()));
  EXPECT_EQ(guess_values(), (Values{2, 2}));
  write(global_problem(4), replace);
  EXPECT_EQ(local_value(), 3);
  EXPECT_EQ(global_value(), 4);
  EXPECT_FALSE(read_solution(path()));
  EXPECT_EQ(guess_values(), Values{});
}

TEST_F(Writing, NoSolutionComesToBelongToAnotherProblem) {
  const Solution solution = local_solution(1);
  for (const bool solved : {true, false}) {
    write(local_problem(1), {}, solved ? &solution : nullptr,
          solved ? std::vector<Solution>{} : std::vector<Solution>{solution});
    for (const bool replace : {true, false}) {
      expect_in("would become those of the global problem",
                refusal([&] { write(global_problem(2), {.append = true, .replace = replace}); }));
    }
  }
  write(global_problem(2), {});
  expect_in("belongs to its global problem, not to the local one",
            refusal([&] { write(local_problem(1), {.append = true}, &solution); }));
  expect_in("belongs to its global problem, not to the local one",
            refusal([&] { write(local_problem(1), {.append = true}, nullptr, {solution}); }));
}

TEST_F(Writing, WithoutValidationTheDataGoesInAsItIs) {
  LocalProblem wrong = local_problem(1);
  wrong.mu[1] = -1;
  expect_in("mu[1]", refusal([&] { write(wrong, {}); }));
  write(wrong, {.validate = false});
  EXPECT_THROW(static_cast<void>(read_problem(path())), Error);
  RawProblem found = read_raw_problem(path(), "local");
  for (auto& [name, value] : found.members) {
    if (name != "mu") continue;
    EXPECT_EQ(std::get<MallocArray<double>>(value)[1], -1);
  }
  // global matrices become triplets only where the data is known to be good
  write(global_problem(1), {.validate = false});
  EXPECT_EQ(std::get<GlobalProblem>(read_problem(path())).M.storage, Storage::dense);
  write(global_problem(1), {});
  EXPECT_EQ(std::get<GlobalProblem>(read_problem(path())).M.storage, Storage::triplet);
}

TEST_F(Writing, WithoutValidationAMatrixThatIsNotThereStaysSo) {
  LocalProblem problem = local_problem(1);
  problem.R = diagonal(2, 1);
  problem.s = Vector::Zero(2);
  write_file(path(), &problem, nullptr, {}, {.validate = false});
  std::vector<std::string_view> names;
  for (const auto& member : read_raw_problem(path(), "local").members) names.push_back(member.name);
  EXPECT_EQ(std::count(names.begin(), names.end(), "V"), 0);
  EXPECT_EQ(std::count(names.begin(), names.end(), "R"), 1);
}

TEST_F(Writing, SolutionsTakeTheirPlace) {
  write(local_problem(1), {});
  write_solution(path(), local_solution(1));
  write_solution(path(), local_solution(2));
  EXPECT_EQ(read_solution(path())->r[0], 2);
  expect_in("/solution: is in the file already",
            refusal([&] { write_solution(path(), local_solution(3), {}); }));
  Solution wrong = local_solution(3);
  wrong.r.conservativeResize(5);
  expect_in("/solution/r: has 5", refusal([&] { write_solution(path(), wrong); }));
}

TEST_F(Writing, GuessesTakeTheirPlaceOrFollow) {
  write(local_problem(1), {}, nullptr, {local_solution(1)});
  EXPECT_EQ(guess_values(), Values{1});
  write_guesses(path(), {local_solution(2), local_solution(3)}, {.append = true});
  EXPECT_EQ(guess_values(), (Values{1, 2, 3}));
  write_guesses(path(), {}, {.append = true});
  EXPECT_EQ(guess_values(), (Values{1, 2, 3}));
  expect_in("/guesses: is in the file already",
            refusal([&] { write_guesses(path(), {local_solution(4)}, {}); }));
  write_guesses(path(), {local_solution(5)});
  EXPECT_EQ(guess_values(), Values{5});
  write_guesses(path(), {});
  EXPECT_EQ(guess_values(), Values{});
  write_guesses(path(), {local_solution(6)}, {.append = true});
  EXPECT_EQ(guess_values(), Values{6});
  Solution wrong = local_solution(7);
  wrong.u.conservativeResize(5);
  for (const WriteOptions& options : {WriteOptions{.append = true}, {.replace = true}}) {
    expect_in("/guesses/2/u: has 5",
              refusal([&] { write_guesses(path(), {local_solution(7), wrong}, options); }));
  }
}

TEST_F(Writing, CompressionIsALevel) {
  const LocalProblem large = local_problem(1, 40);
  std::vector<std::uintmax_t> sizes;
  for (const int level : {0, 1, 9}) {
    write(large, {.dense = true, .compression = level});
    EXPECT_EQ(std::get<LocalProblem>(read_problem(path())).W, large.W);
    sizes.push_back(fs::file_size(path()));
  }
  EXPECT_LT(sizes[1], sizes[0]);
  EXPECT_LE(sizes[2], sizes[1]);
  for (const int level : {-2, 10}) {
    const WriteOptions options{.replace = true, .compression = level};
    const std::string said = "is " + std::to_string(level) + ", but must be 0 to 9";
    expect_in(said, refusal([&] { write(large, options); }));
    expect_in(said, refusal([&] { write_solution(path(), local_solution(1), options); }));
    expect_in(said, refusal([&] { write_guesses(path(), {}, options); }));
    expect_in(said, refusal([&] { write_int_attribute(path(), "a", 1, options); }));
  }
}

TEST_F(Writing, WhatIsKnownOfAMatrixIsKept) {
  LocalProblem problem = local_problem(1);
  problem.W.info = {.comment = "diagonal", .conditioning = 1, .determinant = 1, .rank = 6};
  write(problem, {.dense = true});
  EXPECT_EQ(std::get<LocalProblem>(read_problem(path())).W, problem.W);
}

TEST_F(Writing, AttributesOfTheInfoAreReplacedOnlyWhereThatIsAsked) {
  write(local_problem(1), {});
  write_int_attribute(path(), "contacts", 2, {});
  expect_in("attribute contacts: is in the file already",
            refusal([&] { write_int_attribute(path(), "contacts", 3, {}); }));
  write_int_attribute(path(), "contacts", 3);
  EXPECT_EQ(local_value(), 1);
}

}  // namespace
}  // namespace fclib
