#include "embed/proximal_small/bodies.hpp"
#include "embed/proximal_small/dense.hpp"
#include "embed/proximal_small/few_coordinates.hpp"
#include "embed/proximal_small/groups.hpp"
#include "embed/proximal_small/law.hpp"
#include "embed/proximal_small/solver.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "merit/merit.hpp"
#include "random_data.hpp"
#include "team.hpp"

namespace fclib {
namespace {

using proximal_small::Answer;
using proximal_small::Bodies;
using proximal_small::Dense;
using proximal_small::Ending;
using proximal_small::FewCoordinates;
using proximal_small::Law;
using proximal_small::Serial;
using proximal_small::Solver;
using testing::InStep;
using testing::Team;

constexpr int most_contacts = 6;
constexpr int coordinates = 7;
constexpr double tolerance = 1e-8;

/// Planted problems of each kind; FCLIB_PLANTED=1000 makes it 24,000 in all.
int planted_count() {
  const char* given = std::getenv("FCLIB_PLANTED");
  return given != nullptr ? std::atoi(given) : 40;
}

/// A problem with a solution: contacts that are open, stick and slide, blocks of W of all ranks.
template <class Law>
struct Planted {
  static constexpr int D = Law::dim;
  int nc;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> J;
  Vector inverse, q, guess;
  Eigen::MatrixXd W;
  std::vector<Vector> limits;  // mu, mu_r
  std::vector<double> blocks;
  std::vector<int> starts, columns;

  explicit Planted(int number, double skew = 0) : nc(1 + number % most_contacts) {
    testing::RandomData random(1000 + number);
    const auto uniform = [&] { return 0.5 + 0.5 * std::tanh(random.vector(1)[0]); };
    const int m = D * nc;
    J.setZero(m, coordinates);
    for (int a = 0; a < nc; ++a) {
      const int rank = number % 11 == 0 && a == 0 ? 0 : number % 3 == 0 ? 1 + a % D : D;
      for (int t = 0; t < rank; ++t) {
        Vector row = random.vector(coordinates);
        for (int k = 0; k < coordinates; ++k) row[k] *= (a + k) % 3 == 0 ? 0 : 1;
        const Vector of = rank == D ? Vector(Vector::Unit(D, t)) : random.vector(D);
        J.middleRows(D * a, D) += of * row.transpose();
      }
    }
    inverse = random.vector(coordinates).array().exp();
    W = J * inverse.asDiagonal() * J.transpose();
    if (skew > 0) {
      const Eigen::MatrixXd x =
          Eigen::MatrixXd::NullaryExpr(m, m, [&] { return random.vector(1)[0]; });
      W += Eigen::MatrixXd::Identity(m, m) + skew * (x - x.transpose());
    }
    Vector u = Vector::Zero(m), r = Vector::Zero(m);
    constexpr std::array<double, 4> coefficients{0, 0.3, 1, 4};
    limits.assign(Law::groups, Vector::Zero(nc));
    for (int a = 0; a < nc; ++a) {
      for (Vector& limit : limits) limit[a] = coefficients[static_cast<std::size_t>(4 * uniform())];
      const int state = static_cast<int>(3 * uniform());
      if (state == 0) {  // open
        u.segment(D * a, D) = random.vector(D);
        u[D * a] = 0.1 + uniform();
        continue;
      }
      r[D * a] = 0.1 + uniform();
      for (int g = 0; g < Law::groups; ++g) {
        const int at = D * a + 1 + g * Law::part;
        Vector direction = random.vector(Law::part);
        direction /= direction.norm();
        const double share = state == 1 ? 0.9 * uniform() : 1;  // sticks or slides
        r.segment(at, Law::part) = share * limits[g][a] * r[D * a] * direction;
        if (state == 2) u.segment(at, Law::part) = -uniform() * direction;
      }
    }
    q = u - W * r;
    guess = number % 4 == 0 ? Vector(r + 1e-3 * random.vector(m)) : Vector(Vector::Zero(m));
    starts.push_back(0);
    for (int a = 0; a < nc; ++a) {
      for (int b = 0; b < nc; ++b) {
        const Eigen::MatrixXd block = W.block(D * a, D * b, D, D);
        if (a != b && block.isZero(0)) continue;
        columns.push_back(b);
        for (int i = 0; i < D; ++i) {
          for (int j = 0; j < D; ++j) blocks.push_back(block(i, j));
        }
      }
      starts.push_back(static_cast<int>(columns.size()));
    }
  }

  /// Merit::error of r.
  [[nodiscard]] double judged(const Vector& r) const {
    const auto fill = [&](auto problem) {
      problem.spacedim = D;
      problem.W.storage = Storage::dense;
      problem.W.rows = problem.W.cols = static_cast<Index>(D * nc);
      problem.W.x.assign(W.data(), W.data() + W.size());
      problem.q = q;
      problem.mu = limits[0];
      if constexpr (Law::groups == 2) problem.mu_r = limits[1];
      Solution solution;
      solution.r = r;
      return merit(problem, solution).error;
    };
    if constexpr (Law::groups == 2) {
      return fill(LocalRollingProblem{});
    } else {
      return fill(LocalProblem{});
    }
  }
};

/// How a problem is given to each system, and the system's memory.
template <class Law, class Group>
struct AsMatrix {
  using System = Dense<Law, Group>;
  static int room() { return System::room(most_contacts, true); }
  static void place(System& system, double* at) { system.place(at, most_contacts, true); }
  explicit AsMatrix(const Planted<Law>& problem) : rows(problem.W.transpose()) {
    given = {rows.data(), problem.q.data(), nullptr, nullptr};
  }
  Eigen::MatrixXd rows;
  typename System::Given given;
};
template <class Law, class Group>
struct AsBlocks {
  using System = Dense<Law, Group, true>;
  static int room() { return System::room(most_contacts, false); }
  static void place(System& system, double* at) { system.place(at, most_contacts, false); }
  explicit AsBlocks(const Planted<Law>& problem) {
    given = {problem.blocks.data(), problem.q.data(), problem.starts.data(),
             problem.columns.data()};
  }
  typename System::Given given;
};
template <class Law, class Group>
struct AsBodies {
  using System = Bodies<Law, Group>;
  static int room() { return System::room(most_contacts, coordinates, coordinates); }
  static void place(System& system, double* at) {
    system.place(at, most_contacts, coordinates, coordinates);
  }
  explicit AsBodies(const Planted<Law>& problem) {
    given = {problem.J.data(), problem.inverse.data(), nullptr, problem.q.data()};
  }
  typename System::Given given;
};
template <class Law, class Group>
struct AsFew {
  using System = FewCoordinates<Law, Group, coordinates>;
  static int room() { return System::room(most_contacts); }
  static void place(System& system, double* at) { system.place(at, most_contacts); }
  explicit AsFew(const Planted<Law>& problem) {
    given = {problem.J.data(), problem.inverse.data(), nullptr, problem.q.data()};
  }
  typename System::Given given;
};

/// Solves with one lane of a group: all lanes call it.
template <class Form, class Law, class Group>
Answer solve_with(const Group& group, double* memory, const Form& form, const Planted<Law>& problem,
                  Vector& r, Vector& u) {
  constexpr int own = (most_contacts + Group::size - 1) / Group::size;
  const auto solver = std::make_unique<Solver<typename Form::System, own>>();
  solver->system.group = group;
  solver->rules.tolerance = tolerance;
  Form::place(solver->system, memory);
  const double* limits[Law::groups];
  for (int g = 0; g < Law::groups; ++g) limits[g] = problem.limits[g].data();
  solver->begin(true, problem.nc, form.given, limits, problem.guess.data(), {r.data(), u.data()});
  do solver->advance(true);
  while (!solver->finished());
  return solver->answer();
}

template <template <class, class> class As, class Law>
Answer solve_serially(const Planted<Law>& problem, Vector& r, Vector& u) {
  using Form = As<Law, Serial>;
  std::vector<double> memory(Form::room());
  return solve_with(Serial(), memory.data(), Form(problem), problem, r, u);
}

template <template <class, class> class As, class Law>
void expect_true_words(double least_share, double skew = 0) {
  int solved = 0;
  for (int k = 0; k < planted_count(); ++k) {
    const Planted<Law> problem(k, skew);
    const auto m = problem.q.size();
    Vector r = Vector::Constant(m, NAN), u = r;
    const Answer answer = solve_serially<As>(problem, r, u);
    const double error = problem.judged(r);
    ASSERT_TRUE(r.allFinite());
    // its sums are in double precision: it adds what rounding may hide, which is little here
    EXPECT_GE(answer.error, (1 - 1e-3) * error - 1e-12) << "problem " << k;
    EXPECT_LE(answer.error, (1 + 1e-3) * error + 0.1 * tolerance) << "problem " << k;
    EXPECT_EQ(answer.ending == Ending::converged, answer.error <= tolerance);
    EXPECT_LT((problem.W * r + problem.q - u).norm(), 1e-10 * (1 + r.norm())) << "problem " << k;
    solved += answer.ending == Ending::converged;
  }
  EXPECT_GE(solved, least_share * planted_count());
}

/// A share of the problems that stalls is left to `auto`: those with mu = 4, or without rolling
/// mass.
TEST(ProximalSmall, SaysOnlyWhatTheMeritSays) {
  expect_true_words<AsMatrix, Law<2>>(0.95);
  expect_true_words<AsMatrix, Law<3>>(0.95);
  expect_true_words<AsBlocks, Law<3>>(0.95);
  expect_true_words<AsBodies, Law<2>>(0.95);
  expect_true_words<AsBodies, Law<3>>(0.95);
  expect_true_words<AsFew, Law<3>>(0.95);
}

TEST(ProximalSmall, SolvesContactsThatRoll) {
  expect_true_words<AsMatrix, Law<3, 2>>(0.9);
  expect_true_words<AsMatrix, Law<5, 2>>(0.9);
  expect_true_words<AsBodies, Law<5, 2>>(0.9);
}

TEST(ProximalSmall, TakesMatricesThatAreNotSymmetric) {
  expect_true_words<AsMatrix, Law<3>>(0.95, 0.1);
  expect_true_words<AsBlocks, Law<3>>(0.95, 0.1);
}

TEST(ProximalSmall, StartsFromAGuessAndHasItsOwnWordForBadData) {
  Planted<Law<3>> problem(5);
  const auto m = problem.q.size();
  Vector r(m), u(m);
  ASSERT_EQ(solve_serially<AsBodies>(problem, r, u).ending, Ending::converged);
  problem.guess = r;
  EXPECT_EQ(solve_serially<AsBodies>(problem, r, u).steps, 0);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), HUGE_VAL}) {
    Planted<Law<3>> broken(5);
    broken.W(2, 7) = broken.J(1, 2) = broken.blocks.back() = bad;
    EXPECT_EQ(solve_serially<AsMatrix>(broken, r, u).ending, Ending::invalid);
    EXPECT_EQ(solve_serially<AsBlocks>(broken, r, u).ending, Ending::invalid);
    EXPECT_EQ(solve_serially<AsBodies>(broken, r, u).ending, Ending::invalid);
    EXPECT_EQ(solve_serially<AsFew>(broken, r, u).ending, Ending::invalid);
    EXPECT_TRUE(r.array().isNaN().all());
    EXPECT_TRUE(u.array().isNaN().all());
  }
  for (Vector Planted<Law<3>>::* of : {&Planted<Law<3>>::q, &Planted<Law<3>>::guess}) {
    Planted<Law<3>> broken(5);
    (broken.*of)[1] = NAN;
    EXPECT_EQ(solve_serially<AsMatrix>(broken, r, u).ending, Ending::invalid);
  }
  Planted<Law<3>> broken(5);
  broken.limits[0][2] = -0.1;
  const Answer answer = solve_serially<AsMatrix>(broken, r, u);
  EXPECT_EQ(answer.ending, Ending::invalid);
  EXPECT_EQ(answer.error, HUGE_VAL);
}

TEST(ProximalSmall, LeavesWhatHasNoSolution) {
  Planted<Law<3>> problem(0);  // one contact
  problem.W.setZero();
  problem.q << -1, 0, 0;
  Vector r(3), u(3);
  const Answer answer = solve_serially<AsMatrix>(problem, r, u);
  EXPECT_EQ(answer.ending, Ending::unsolved);
  EXPECT_GT(answer.error, 0.1);
}

/// With more lanes than rows, each has a part of a row.
template <template <class, class> class As, int N>
void expect_team_agrees(int first, int count) {
  using Form = As<Law<3>, Team<N>>;
  for (int k = first; k < first + count; ++k) {
    const Planted<Law<3>> problem(k);
    const auto m = problem.q.size();
    Vector r = Vector::Constant(m, NAN), u = r, serial_r = r, serial_u = r;
    std::vector<double> memory(Form::room());
    const Form form(problem);
    std::array<Answer, N> answers;
    Team<N>::run([&](const Team<N>& team) {
      answers[team.number] = solve_with(team, memory.data(), form, problem, r, u);
    });
    const Answer serial = solve_serially<As>(problem, serial_r, serial_u);
    for (const Answer& answer : answers) {
      EXPECT_EQ(answer.error, answers[0].error);
      EXPECT_EQ(answer.steps, answers[0].steps);
    }
    EXPECT_EQ(answers[0].ending, serial.ending) << "problem " << k;
    EXPECT_NEAR(problem.judged(r), answers[0].error, 1e-3 * answers[0].error + 1e-12);
  }
}

TEST(ProximalSmall, ATeamOfLanesFindsWhatOneFinds) {
  expect_team_agrees<AsMatrix, 4>(3, 3);
  expect_team_agrees<AsBlocks, 4>(3, 2);
  expect_team_agrees<AsBodies, 4>(3, 2);
  expect_team_agrees<AsBodies, 32>(4, 1);
  expect_team_agrees<AsFew, 4>(3, 2);
}

/// Groups of a warp have problems of different numbers of contacts, and one has none at all.
template <template <class, class> class As>
void expect_groups_stay_in_step(int first) {
  constexpr int lanes = 2, groups = 3;
  using Group = InStep<lanes, groups>;
  using Form = As<Law<3>, Group>;
  using Problem = Planted<Law<3>>;
  const std::vector<Problem> problems{Problem(first), Problem(first + 3)};
  std::vector<Vector> r, u;
  for (const Problem& problem : problems) {
    r.emplace_back(Vector::Zero(problem.q.size()));
    u.emplace_back(Vector::Zero(problem.q.size()));
  }
  std::vector<std::vector<double>> memory(groups, std::vector<double>(Form::room()));
  std::array<Answer, lanes * groups> answers;
  Group::run([&](const Group& group, int own) {
    const bool busy = own < 2;
    const Problem& problem = problems[busy ? own : 0];
    const Form form(problem);
    const auto solver = std::make_unique<Solver<typename Form::System, most_contacts / lanes>>();
    solver->system.group = group;
    Form::place(solver->system, memory[own].data());
    const double* limits[1] = {problem.limits[0].data()};
    const int to = busy ? own : 0;
    solver->begin(busy, busy ? problem.nc : 0, form.given, limits, problem.guess.data(),
                  {r[to].data(), u[to].data()});
    while (group.anyone(busy && !solver->finished())) solver->advance(busy && !solver->finished());
    answers[group.number] = solver->answer();
  });
  for (int k = 0; k < 2; ++k) {
    EXPECT_EQ(answers[lanes * k].ending, Ending::converged);
    EXPECT_LE(problems[k].judged(r[k]), 1.001 * tolerance);
  }
}

TEST(ProximalSmall, GroupsOfAWarpStayInStep) {
  expect_groups_stay_in_step<AsMatrix>(2);
  expect_groups_stay_in_step<AsBlocks>(2);
  expect_groups_stay_in_step<AsBodies>(2);
  expect_groups_stay_in_step<AsFew>(2);
}

}  // namespace
}  // namespace fclib
