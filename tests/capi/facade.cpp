// What fclib.hpp promises; ends with 0 where it holds: facade FOLDER.
#include <array>
#include <cstdio>
#include <fclib.hpp>
#include <functional>
#include <string>
#include <vector>

namespace {

int failures = 0;

void check(bool condition, int line) {
  if (condition) return;
  std::fprintf(stderr, "line %d\n", line);
  ++failures;
}
#define CHECK(condition) check(condition, __LINE__)

void throws(const std::string& words, const std::function<void()>& call, int line) {
  try {
    call();
  } catch (const fclib::Error& error) {
    if (std::string(error.what()).find(words) == std::string::npos) {
      std::fprintf(stderr, "line %d: %s\n", line, error.what());
      ++failures;
    }
    return;
  }
  check(false, line);
}
#define THROWS(words, ...) throws(words, [&] { __VA_ARGS__; }, __LINE__)

/// A ball of 1 kg on a plane, in each storage, with and without a body.
struct Ball {
  std::array<double, 9> full{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> one{1, 1, 1}, q{-1, 2, 0}, none{};
  std::array<int, 4> starts{0, 1, 2, 3};
  std::array<int, 3> places{0, 1, 2};
  std::array<double, 1> mu{0.5};
  fclib_matrix W = fclib::dense(3, 3, full);
  fclib_matrix M = fclib::triplets(3, 3, places, places, one);
  fclib_matrix H = fclib::columns(3, 3, starts, places, one);

  fclib_local local() {
    fclib_local problem{};
    problem.W = &W;
    problem.q = q.data();
    problem.mu = mu.data();
    problem.spacedim = 3;
    return problem;
  }
  fclib_global global() {
    fclib_global problem{};
    problem.M = &M;
    problem.H = &H;
    problem.f = q.data();
    problem.w = none.data();
    problem.mu = mu.data();
    problem.spacedim = 3;
    return problem;
  }
};

void files(const std::string& folder) {
  Ball ball;
  const std::string path = folder + "/ball.hdf5";
  fclib::write(path, ball.global());
  CHECK(fclib::kind(path) == "global");
  THROWS("global", fclib::write(path, ball.global()));
  THROWS("holds no", fclib::read<fclib_local>(path));
  THROWS("no such file", fclib::read<fclib_global>(folder + "/missing"));
  THROWS("holds no solution", fclib::read_solution(path));

  // C would cut the path
  const std::string cut = path + std::string("\0.hdf5", 6);
  const std::string words = "a path has a zero byte, at " + std::to_string(path.size());
  THROWS(words, fclib::read<fclib_global>(cut));
  THROWS(words, fclib::write(cut, ball.local()));
  THROWS(words, fclib::kind(cut));
  THROWS(words, fclib::read_solution(cut));
  THROWS(words, fclib::read_guesses(cut));
  THROWS(words, fclib::SequenceWriter{cut});
  THROWS(words, fclib::SequenceWriter(cut, fclib::Start::go_on));
  THROWS(words, fclib::sequence_size(cut));

  CHECK(fclib::read_guesses(path).empty());
  THROWS("no such file", fclib::read_guesses(folder + "/missing"));

  auto problem = fclib::read<fclib_global>(path);
  const fclib::Sizes size = fclib::sizes(*problem);
  CHECK(size.n == 3 && size.m == 3 && size.p == 0 && size.nc == 1);
  CHECK(fclib::mu(*problem)[0] == 0.5 && fclib::f(*problem)[1] == 2);
  CHECK(fclib::w(*problem).size() == 3 && fclib::b(*problem).empty());
  fclib::mu(*problem)[0] = 0.25;
  CHECK(problem->mu[0] == 0.25);
  static_assert(
      std::is_same_v<decltype(fclib::mu(std::as_const(*problem))), std::span<const double>>);

  fclib::Solution solution;
  solution.r = {1, -0.5};
  THROWS("r has 2 entries, expected 3", fclib::write_solution(path, solution));
  solution.r = {1, -0.5, 0};
  fclib::write_solution(path, solution);  // u and v follow
  CHECK(fclib::read_solution(path).v == (std::vector<double>{0, 1.5, 0}));
  fclib::write_guesses(path, std::vector{solution, fclib::Solution(size)});
  const auto guesses = fclib::read_guesses(path);
  CHECK(guesses.size() == 2 && guesses[0].r == solution.r && guesses[1].u.size() == 3);
}

void sequence(const std::string& folder) {
  Ball ball;
  const std::string path = folder + "/run.h5";
  fclib::Solution solution;
  solution.r = {1, -0.5, 0};
  {
    fclib::SequenceWriter writer(path);
    writer.add(ball.local());
    writer.add_solution(solution);
    writer.flush();
    CHECK(fclib::sequence_size(path) == 1);
    writer.add(ball.global(), 3);
    writer.add_guesses(std::vector{solution, solution});
    solution.r.pop_back();
    THROWS("r has 2 entries, expected 3", writer.add_solution(solution));
    writer.close();
  }
  CHECK(fclib::read<fclib_local>(path + "#0")->q[1] == 2);
  CHECK(fclib::read_solution(path + "#0").u[1] == 1.5);
  CHECK(fclib::read_guesses(path + "#1").size() == 2);
  {
    fclib::SequenceWriter(path, fclib::Start::go_on).add(ball.local());
  }
  CHECK(fclib::sequence_size(path) == 3);
  THROWS("no such file", fclib::sequence_size(folder + "/missing"));
}

template <class C>
void solving(C problem) {
  const fclib::Result result = fclib::solve(problem, "nsgs", {.tolerance = 1e-10});
  CHECK(result.converged() && result.status_name() == "converged" && result.iterations > 0);
  CHECK(fclib::merit(problem, result.solution) <= 1e-10);
  CHECK(result.error == fclib::merit(problem, result.solution));
  const std::array<double, 2> guess{};
  THROWS("has 2 entries, expected 3", fclib::solve(problem, "auto", {.guess = guess}));
  THROWS("no_such", fclib::solve(problem, "no_such"));
  THROWS("no_such", fclib::solve(problem, "nsgs", {.solver_options = {{"no_such", "1"}}}));
  const std::string name("nsgs\0x", 6);
  THROWS("the name of a solver has a zero byte, at 4", fclib::solve(problem, name));
  THROWS("the value of an option has",
         fclib::solve(problem, "nsgs", {.solver_options = {{"sor", name}}}));
  int told = 0;
  const auto cut = fclib::solve(problem, "nsgs", {.progress = [&](const fclib::Progress& progress) {
                                  ++told;
                                  return progress.error < 0;
                                }});
  CHECK(told == 1 && cut.status == FCLIB_INTERRUPTED && cut.solution.r.size() == 3);
  THROWS("mine", fclib::solve(problem, "nsgs", {.progress = [](const fclib::Progress&) -> bool {
                                throw fclib::Error("mine");
                              }}));
  THROWS("r", fclib::merit(problem, fclib::Solution()));
  problem.mu = nullptr;
  THROWS("mu", fclib::solve(problem));
}

void pictures(const std::string& path) {
  Ball ball;
  fclib::write(path, ball.local());
  const std::array<int, 2> body{0, 1};
  const std::array<int, 2> moves{0, 1};
  const std::array<int, 2> kind{FCLIB_PLANE, FCLIB_SPHERE};
  const std::array<double, 3> up{0, 0, 1};
  const std::array<double, 3> along{1, 0, 0};
  const std::array<double, 6> place{0, 0, 0, 0, 0, 0.1};
  const std::array<double, 6> size{0, 0, 0, 0.1, 0, 0};
  const std::vector<std::string> name{"ground", "ball"};
  fclib::Geometry geometry{.body = body,
                           .point = ball.none,
                           .normal = up,
                           .tangent = along,
                           .name = name,
                           .moves = moves,
                           .place = place,
                           .shape_kind = kind,
                           .shape_size = size};
  fclib::write_geometry(path, geometry);
  THROWS("is in the file already", fclib::write_geometry(path, geometry));
  geometry.unit = std::string("m\0m", 3);
  THROWS("unit has a zero byte, at 1", fclib::write_geometry(path, geometry));
  geometry.unit.clear();
  geometry.mass = up;
  THROWS("mass has 3 entries, expected 2", fclib::write_geometry(path, geometry));
  geometry.mass = {};
  geometry.velocity = up;
  geometry.impulse = place;
  THROWS("velocity has 3 entries, expected 6", fclib::write_geometry(path, geometry));
  geometry.velocity = geometry.impulse = {};
  geometry.place = up;
  THROWS("place has 3 entries, expected 6", fclib::write_geometry(path, geometry));
  geometry.place = {};
  THROWS("/bodies/place: is NULL", fclib::write_geometry(path, geometry));
  geometry.mesh_first = body;
  geometry.mesh_first = geometry.mesh_first.first(1);
  THROWS("odd", fclib::write_geometry(path, geometry));
}

void matrices() {
  const std::array<double, 3> x{};
  const std::array<int, 2> two{};
  THROWS("expected 4", fclib::dense(2, 2, x));
  THROWS("negative", fclib::dense(-1, 2, x));
  THROWS("starts has 2 entries, expected 4", fclib::rows(3, 2, two, two, x));
  THROWS("columns has 2", fclib::triplets(3, 3, std::array<int, 3>{}, two, x));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  fclib_set_error_handler(nullptr, nullptr);
  files(argv[1]);
  Ball ball;
  solving(ball.local());
  solving(ball.global());
  matrices();
  sequence(argv[1]);
  pictures(std::string(argv[1]) + "/pictures.hdf5");
  CHECK(!fclib::solvers().empty() && fclib::solvers()[0] == fclib_solver_name(0));
  return failures == 0 ? 0 : 1;
}
