#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "convert/component_order.hpp"
#include "convert/embed.hpp"
#include "convert/islands.hpp"
#include "convert/storage.hpp"
#include "convert/units.hpp"
#include "merit/merit.hpp"
#include "random_problems.hpp"

namespace fclib {
namespace {

/// Contacts 0 and 2 on one body, 1 on another, in the plane; one body touches nothing.
GlobalProblem three_bodies() {
  GlobalProblem problem;
  problem.spacedim = 2;
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(6, 6);
  h.block(2, 0, 2, 2) = Eigen::Matrix2d::Identity();
  h.block(2, 4, 2, 2) = 2 * Eigen::Matrix2d::Identity();
  h.block(4, 2, 2, 2) = Eigen::Matrix2d::Identity();
  const Eigen::MatrixXd mass = Eigen::VectorXd::LinSpaced(6, 1, 6).asDiagonal();
  problem.M = Matrix::from_eigen(mass.sparseView());
  problem.H = Matrix::from_eigen(h.sparseView());
  problem.f = -Vector::Ones(6);
  problem.w = Vector::Zero(6);
  problem.mu = Vector::Constant(3, 0.3);
  validate(problem);
  return problem;
}

TEST(Islands, are_numbered_by_their_first_contact) {
  const Islands found = islands(three_bodies());
  EXPECT_EQ(found.count, 3);
  EXPECT_EQ(found.contact, (std::vector<Index>{0, 1, 0}));
  EXPECT_EQ(found.dof, (std::vector<Index>{2, 2, 0, 0, 1, 1}));
}

TEST(Islands, split_and_merge_are_inverse) {
  const GlobalProblem problem = three_bodies();
  const Islands found = islands(problem);
  const std::vector<GlobalProblem> parts = split(problem, found);
  ASSERT_EQ(parts.size(), 3U);
  for (const GlobalProblem& part : parts) validate(part);
  EXPECT_EQ(parts[0].mu.size(), 2);
  EXPECT_EQ(parts[2].mu.size(), 0);
  const GlobalProblem again = merge(parts, found);
  EXPECT_EQ(again.M, problem.M);
  EXPECT_TRUE(again.G.empty());
  EXPECT_EQ(again.H, problem.H);
  EXPECT_EQ(again.f, problem.f);
}

TEST(ComponentOrder, there_and_back) {
  const GlobalProblem problem = three_bodies();
  for (const auto order : {ComponentOrder::normal_last, ComponentOrder::normals_first}) {
    const GlobalProblem there = to_order(problem, order);
    EXPECT_NE(there.H, problem.H);
    EXPECT_EQ(from_order(there, order).H, problem.H);
  }
}

TEST(Embedding, and_units_keep_what_is_a_solution) {
  const GlobalProblem problem = three_bodies();
  // each body stops: contact 0 bears the first
  Solution solution{.r = Vector::Zero(6)};
  solution.r << 1, 0.3, 1, 0.3, 0, 0;
  const double error = merit(problem, solution).error;
  EXPECT_NEAR(merit(embed(problem), embed(solution, problem)).natural, error, 1e-14);
  const Scaling scaling{.velocity = 8, .impulse = 8};
  EXPECT_NEAR(merit(scaled(problem, scaling), scaled(solution, problem, scaling)).natural, error,
              1e-14);
}

using testing::dense;
using testing::RandomData;

/// The message of the error that an action throws; "nothing" where it does not.
template <class Action>
std::string error_of(ErrorKind kind, Action&& action) {
  try {
    action();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind, kind);
    return error.what();
  }
  return "nothing";
}

bool says(const std::string& message, const std::string& words) {
  return message.find(words) != std::string::npos;
}

TEST(Arrangement, puts_entries_in_their_places_and_takes_them_back) {
  const Places places{.to = {3, 0, 1}, .count = 4};
  EXPECT_EQ(arranged(Vector(Eigen::Vector3d(1, 2, 3)), places), Eigen::Vector4d(2, 3, 0, 1));
  EXPECT_EQ(gathered(Vector(Eigen::Vector4d(2, 3, 9, 1)), places), Eigen::Vector3d(1, 2, 3));
  for (const auto storage : {Storage::csr, Storage::csc, Storage::triplet, Storage::dense}) {
    Eigen::MatrixXd a(3, 2);
    a << 1, 2, 3, 4, 5, 6;
    const Matrix there = arranged(converted(Matrix::from_eigen(a.sparseView()), storage), places,
                                  Places{.to = {1, 0}, .count = 3});
    Eigen::MatrixXd expected(4, 3);
    expected << 4, 3, 0, 6, 5, 0, 0, 0, 0, 2, 1, 0;
    EXPECT_EQ(dense(there), expected);
    EXPECT_EQ(there.storage, storage);
  }
}

TEST(Arrangement, a_problem_keeps_what_it_does_not_have) {
  RandomData random(41);
  const auto problem = testing::random_local<LocalProblem>(random, 3, 2, 0);
  const LocalProblem same = arranged(problem, Arrangement::of(problem));
  EXPECT_EQ(dense(same.W), dense(problem.W));
  EXPECT_TRUE(same.V.empty() && same.R.empty());
  EXPECT_EQ(same.s.size(), 0);
  Solution solution;
  solution.r = random.vector(6);
  EXPECT_EQ(arranged(solution, Arrangement::of(problem)).u.size(), 0);
  EXPECT_EQ(gathered(solution, Arrangement::of(problem)).u.size(), 0);
  EXPECT_EQ(gathered(solution, Arrangement::of(problem)).r, solution.r);
}

TEST(ComponentOrder, each_component_has_its_place) {
  using Order = std::vector<Index>;
  EXPECT_EQ(component_places(ComponentOrder::normal_first, 2, 3).to, (Order{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(component_places(ComponentOrder::normal_last, 2, 3).to, (Order{2, 0, 1, 5, 3, 4}));
  EXPECT_EQ(component_places(ComponentOrder::normals_first, 2, 3).to, (Order{0, 2, 3, 1, 4, 5}));
  EXPECT_EQ(component_places(ComponentOrder::normals_first, 3, 2).to, (Order{0, 3, 1, 4, 2, 5}));
}

TEST(ComponentOrder, has_names) {
  EXPECT_EQ(component_order_of("normal-first"), ComponentOrder::normal_first);
  EXPECT_EQ(component_order_of("normal-last"), ComponentOrder::normal_last);
  EXPECT_EQ(component_order_of("normals-first"), ComponentOrder::normals_first);
  const std::string message =
      error_of(ErrorKind::option, [] { component_order_of("normals-last"); });
  EXPECT_TRUE(says(message, "no order 'normals-last'; there are: normal-first, normal-last"));
}

TEST(ComponentOrder, moves_every_member_there_and_back) {
  RandomData random(42);
  const auto problem = testing::random_local<LocalProblem>(random, 3, 3, 2);
  const LocalProblem there = to_order(problem, ComponentOrder::normals_first);
  const std::vector<Index> to = {0, 3, 4, 1, 5, 6, 2, 7, 8};
  for (Index k = 0; k < 9; ++k) {
    EXPECT_EQ(there.q[to[k]], problem.q[k]);
    EXPECT_EQ(dense(there.V).row(to[k]), dense(problem.V).row(k));
    EXPECT_EQ(dense(there.W)(to[k], to[0]), dense(problem.W)(k, 0));
  }
  EXPECT_EQ(there.s, problem.s);
  const LocalProblem back = from_order(there, ComponentOrder::normals_first);
  EXPECT_EQ(dense(back.W), dense(problem.W));
  EXPECT_EQ(dense(back.V), dense(problem.V));
  EXPECT_EQ(back.q, problem.q);
}

/// Four contacts in the plane: a joint links 0 and 2, another touches none; 1 and 3 have a zero
/// that is stored between them.
LocalProblem with_joints() {
  LocalProblem problem;
  problem.spacedim = 2;
  Matrix w{
      .storage = Storage::triplet, .rows = 8, .cols = 8, .p = {}, .i = {}, .x = {}, .info = {}};
  for (Index k = 0; k < 8; ++k) {
    w.i.push_back(k);
    w.p.push_back(k);
    w.x.push_back(k + 1);
  }
  w.i.push_back(2);
  w.p.push_back(6);
  w.x.push_back(0);
  problem.W = w;
  problem.V = Matrix{.storage = Storage::triplet,
                     .rows = 8,
                     .cols = 2,
                     .p = {0, 0},
                     .i = {1, 4},
                     .x = {5, 6},
                     .info = {}};
  problem.R =
      converted(Matrix::from_eigen(SparseColumns(2 * Eigen::MatrixXd::Identity(2, 2).sparseView())),
                Storage::csc);
  problem.q = Vector::LinSpaced(8, 1, 8);
  problem.s = Eigen::Vector2d(10, 20);
  problem.mu = Eigen::Vector4d(0.1, 0.2, 0.3, 0.4);
  problem.info.title = "four";
  validate(problem);
  return problem;
}

TEST(Islands, are_linked_by_joints_and_not_by_stored_zeros) {
  const Islands found = islands(with_joints());
  EXPECT_EQ(found.count, 4);
  EXPECT_EQ(found.spacedim, 2);
  EXPECT_EQ(found.contact, (std::vector<Index>{0, 1, 0, 2}));
  EXPECT_EQ(found.bilateral, (std::vector<Index>{0, 3}));
  EXPECT_EQ(found.size(Dim::m), 8);
  EXPECT_EQ(found.size(Dim::nc), 4);
  EXPECT_EQ(found.size(Dim::n), 0);
  EXPECT_EQ(found.size(Dim::p), 2);
  EXPECT_EQ(found.of(Dim::m, 5), 0);
  EXPECT_EQ(found.of(Dim::m, 7), 2);
  EXPECT_EQ(found.of(Dim::nc, 3), 2);
  EXPECT_EQ(found.of(Dim::p, 1), 3);
  EXPECT_EQ(islands(three_bodies()).of(Dim::n, 4), 1);
  // and where their entries stand in the whole
  const Arrangement first = places_of(found).front();
  EXPECT_EQ(first.nc.to, (std::vector<Index>{0, 2}));
  EXPECT_EQ(first.m.to, (std::vector<Index>{0, 1, 4, 5}));
  EXPECT_EQ(first.p.to, (std::vector<Index>{0}));
  EXPECT_EQ(first.nc.count, 4);
  EXPECT_EQ(first.m.count, 8);
  EXPECT_EQ(first.p.count, 2);
  EXPECT_EQ(places_of(islands(three_bodies())).front().n.count, 6);
}

TEST(Islands, are_linked_through_bodies_and_their_joints) {
  GlobalProblem problem = three_bodies();
  // the first joint links the two bodies that touch something, the second holds the third
  Eigen::MatrixXd g = Eigen::MatrixXd::Zero(6, 2);
  g(2, 0) = 1;
  g(4, 0) = -1;
  g(0, 1) = 1;
  problem.G = Matrix::from_eigen(g.sparseView());
  problem.b = Vector::Zero(2);
  const Islands found = islands(problem);
  EXPECT_EQ(found.count, 2);
  EXPECT_EQ(found.contact, (std::vector<Index>{0, 0, 0}));
  EXPECT_EQ(found.dof, (std::vector<Index>{1, 1, 0, 0, 0, 0}));
  EXPECT_EQ(found.bilateral, (std::vector<Index>{0, 1}));
}

TEST(Islands, a_solution_without_velocities_stays_without_them) {
  const Islands one{.count = 1, .spacedim = 3, .contact = {}, .dof = {0}, .bilateral = {}};
  const Solution whole = merge(std::vector<Solution>(1), one);
  EXPECT_EQ(whole.v.size(), 0);
  EXPECT_EQ(whole.r.size(), 0);
}

TEST(Islands, of_what_all_touches_contacts_have_no_rest) {
  RandomData random(43);
  const Islands one = islands(testing::random_local<LocalProblem>(random, 3, 3, 2));
  EXPECT_EQ(one.count, 1);
  LocalProblem none;
  none.W =
      Matrix{.storage = Storage::csr, .rows = 0, .cols = 0, .p = {0}, .i = {}, .x = {}, .info = {}};
  EXPECT_EQ(islands(none).count, 0);
}

TEST(Islands, a_chain_of_links_is_one_group_with_its_first_node_as_root) {
  Groups groups(6);
  groups.link(5, 4);
  groups.link(3, 2);
  groups.link(4, 3);
  EXPECT_EQ(groups.find(5), 2);
  EXPECT_EQ(groups.find(2), 2);
  EXPECT_EQ(groups.find(1), 1);
  groups.link(5, 1);
  for (Index node = 1; node < 6; ++node) EXPECT_EQ(groups.find(node), 1);
  EXPECT_EQ(groups.find(0), 0);
}

TEST(Islands, each_part_has_its_own_numbers) {
  const LocalProblem problem = with_joints();
  const Islands found = islands(problem);
  const std::vector<LocalProblem> parts = split(problem, found);
  ASSERT_EQ(parts.size(), 4U);
  EXPECT_EQ(parts[0].q, Eigen::Vector4d(1, 2, 5, 6));
  EXPECT_EQ(parts[0].mu, Eigen::Vector2d(0.1, 0.3));
  EXPECT_EQ(parts[0].s, Vector::Constant(1, 10));
  EXPECT_EQ(dense(parts[0].W), Eigen::MatrixXd(Eigen::Vector4d(1, 2, 5, 6).asDiagonal()));
  EXPECT_EQ(dense(parts[0].V), Eigen::Vector4d(0, 5, 6, 0));
  EXPECT_EQ(parts[0].R.storage, Storage::csc);
  EXPECT_EQ(dense(parts[2].W), Eigen::MatrixXd(Eigen::Vector2d(7, 8).asDiagonal()));
  // what has no joint is a plain problem
  EXPECT_TRUE(parts[1].V.empty() && parts[1].R.empty());
  EXPECT_EQ(parts[3].s, Vector::Constant(1, 20));
  EXPECT_EQ(parts[3].R.rows, 1);
  for (const LocalProblem& part : parts) {
    validate(part);
    EXPECT_EQ(part.spacedim, 2);
    EXPECT_EQ(part.info.title, "four");
  }
  const LocalProblem again = merge(parts, found);
  EXPECT_EQ(dense(again.W), dense(problem.W));
  EXPECT_EQ(dense(again.V), dense(problem.V));
  EXPECT_EQ(again.W.storage, Storage::triplet);
  EXPECT_EQ(again.R, problem.R);
  EXPECT_EQ(again.q, problem.q);
  EXPECT_EQ(again.s, problem.s);
  EXPECT_EQ(again.mu, problem.mu);
  EXPECT_EQ(again.spacedim, 2);
  EXPECT_EQ(again.info.title, "four");
}

TEST(Islands, solutions_are_split_and_merged_as_their_problems) {
  RandomData random(44);
  const GlobalProblem problem = three_bodies();
  const Islands found = islands(problem);
  const Solution solution = testing::random_solution(random, problem, false, true);
  const std::vector<Solution> parts = split(solution, found);
  EXPECT_EQ(parts[1].r, solution.r.segment(2, 2));
  EXPECT_EQ(parts[1].v, solution.v.segment(4, 2));
  EXPECT_EQ(parts[2].v, solution.v.head(2));
  EXPECT_EQ(parts[1].u.size(), 0);
  const Solution again = merge(parts, found);
  EXPECT_EQ(again.r, solution.r);
  EXPECT_EQ(again.v, solution.v);
  EXPECT_EQ(again.u.size(), 0);
}

TEST(Islands, what_does_not_fit_is_an_error) {
  LocalProblem problem = with_joints();
  const Islands found = islands(problem);
  const auto split_fails = [&](const LocalProblem& wrong) {
    return error_of(ErrorKind::problem, [&] { split(wrong, found); });
  };
  LocalProblem linked = problem;
  linked.W.x.back() = 1;
  EXPECT_TRUE(says(split_fails(linked), "W: entry (2, 6) links two islands"));
  LocalProblem shorter = problem;
  shorter.q.conservativeResize(7);
  EXPECT_TRUE(says(split_fails(shorter), "q: has 7 entries, expected m = 8"));
  LocalProblem narrow = problem;
  narrow.W.cols = 7;
  EXPECT_TRUE(says(split_fails(narrow), "W: has 7 columns, expected m = 8"));
  LocalProblem flat = problem;
  flat.V.rows = 7;
  EXPECT_TRUE(says(split_fails(flat), "V: has 7 rows, expected m = 8"));
  LocalProblem wide = problem;
  wide.V.cols = 3;
  EXPECT_TRUE(says(split_fails(wide), "V: has 3 columns, expected p = 2"));
  LocalProblem unjoined = problem;
  unjoined.s.conservativeResize(1);
  EXPECT_TRUE(says(split_fails(unjoined), "s: has 1 entries, expected p = 2"));

  const auto merge_fails = [&](const std::vector<LocalProblem>& wrong) {
    return error_of(ErrorKind::problem, [&] { merge(wrong, found); });
  };
  std::vector<LocalProblem> parts = split(problem, found);
  parts[2].q.conservativeResize(1);
  EXPECT_TRUE(says(merge_fails(parts), "part 2: q: has 1 entries, expected"));
  parts = split(problem, found);
  for (LocalProblem& part : parts) part.q.resize(0);
  EXPECT_TRUE(says(merge_fails(parts), "part 0: q: has 0 entries, expected m = 4"));
  parts = split(problem, found);
  parts[1].W.rows = 3;
  EXPECT_TRUE(says(merge_fails(parts), "part 1: W: has 3 rows, expected"));
  parts = split(problem, found);
  parts[1].W.cols = 3;
  EXPECT_TRUE(says(merge_fails(parts), "part 1: W: has 3 columns, expected"));
  parts.pop_back();
  EXPECT_TRUE(says(merge_fails(parts), "3 parts for 4 islands"));
}

TEST(Islands, independent_problems_beside_each_other_are_one) {
  RandomData random(45);
  const std::vector<GlobalProblem> problems = {
      testing::random_global<GlobalProblem>(random, 5, 2, 1, 0),
      testing::random_global<GlobalProblem>(random, 3, 2, 2, 1)};
  const Islands places = beside(problems);
  EXPECT_EQ(places.count, 2);
  EXPECT_EQ(places.spacedim, 2);
  EXPECT_EQ(places.contact, (std::vector<Index>{0, 1, 1}));
  EXPECT_EQ(places.dof, (std::vector<Index>{0, 0, 0, 0, 0, 1, 1, 1}));
  EXPECT_EQ(places.bilateral, (std::vector<Index>{1}));
  const GlobalProblem whole = merge(problems, places);
  validate(whole);
  EXPECT_EQ(dense(whole.M).topLeftCorner(5, 5), dense(problems[0].M));
  EXPECT_EQ(dense(whole.M).bottomRightCorner(3, 3), dense(problems[1].M));
  EXPECT_EQ(dense(whole.H).bottomRightCorner(3, 4), dense(problems[1].H));
  EXPECT_EQ(whole.G.rows, 8);
  EXPECT_EQ(whole.b, problems[1].b);
  EXPECT_EQ(whole.f.tail(3), problems[1].f);

  EXPECT_TRUE(says(error_of(ErrorKind::problem, [] { beside(std::vector<GlobalProblem>{}); }),
                   "there is no problem to merge"));
  const std::vector<GlobalProblem> mixed = {
      problems[0], problems[1], testing::random_global<GlobalProblem>(random, 3, 3, 1, 0)};
  EXPECT_TRUE(says(error_of(ErrorKind::problem, [&] { beside(mixed); }),
                   "part 2: spacedim: is 3, that of the first is 2"));
}

TEST(Embedding, new_rows_of_a_local_problem_hold_the_mean_of_their_contact) {
  RandomData random(46);
  auto planar = testing::random_local<LocalProblem>(random, 2, 3, 2);
  for (double& value : planar.W.x) value *= 0.1;
  // the last contact has no inertia of its own
  Eigen::MatrixXd w = dense(planar.W);
  w.bottomRows(2).setZero();
  w.rightCols(2).setZero();
  planar.W = Matrix::from_eigen(w.sparseView());
  const LocalProblem spatial = embed(planar);
  validate(spatial);
  EXPECT_EQ(spatial.spacedim, 3);
  EXPECT_EQ(spatial.W.storage, planar.W.storage);
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(9, 9);
  const std::vector<Index> to = {0, 1, 3, 4, 6, 7};
  for (Index i = 0; i < 6; ++i) {
    EXPECT_EQ(spatial.q[to[i]], planar.q[i]);
    EXPECT_EQ(dense(spatial.V).row(to[i]), dense(planar.V).row(i));
    for (Index j = 0; j < 6; ++j) expected(to[i], to[j]) = w(i, j);
  }
  expected(2, 2) = (w(0, 0) + w(1, 1)) / 2;
  expected(5, 5) = (w(2, 2) + w(3, 3)) / 2;
  expected(8, 8) = 1;
  EXPECT_LT((dense(spatial.W) - expected).norm(), 1e-14);
  EXPECT_EQ(spatial.q[2], 0);
}

TEST(Embedding, rolling_components_go_beside_their_own) {
  RandomData random(47);
  const auto planar = testing::random_local<LocalRollingProblem>(random, 3, 2, 0);
  const LocalRollingProblem spatial = embed(planar);
  validate(spatial);
  EXPECT_EQ(spatial.spacedim, 5);
  // N, T, R become N, T, 0, R, 0
  EXPECT_EQ(spatial_places(planar).m.to, (std::vector<Index>{0, 1, 3, 5, 6, 8}));
  const Eigen::MatrixXd w = dense(planar.W);
  const double mean = (w(3, 3) + w(4, 4) + w(5, 5)) / 3;
  EXPECT_NEAR(dense(spatial.W)(7, 7), mean, 1e-15);
  EXPECT_NEAR(dense(spatial.W)(9, 9), mean, 1e-15);
  EXPECT_EQ(dense(spatial.W)(8, 8), w(5, 5));
  const Solution solution = testing::random_solution(random, planar, true, false);
  const Solution there = embed(solution, planar);
  EXPECT_EQ(there.r[8], solution.r[5]);
  EXPECT_EQ(there.r[7], 0);
  EXPECT_EQ(flatten(there, planar).r, solution.r);
  EXPECT_EQ(flatten(there, planar).u, solution.u);
  EXPECT_NEAR(merit(spatial, there).natural, merit(planar, solution).natural, 1e-12);
}

TEST(Embedding, a_global_problem_gets_bodies_at_rest_of_the_mean_mass) {
  const GlobalProblem planar = three_bodies();
  const GlobalProblem spatial = embed(planar);
  validate(spatial);
  EXPECT_EQ(spatial.M.rows, 9);
  const Eigen::MatrixXd mass = dense(spatial.M);
  EXPECT_EQ(mass.topLeftCorner(6, 6), dense(planar.M));
  EXPECT_EQ(Eigen::MatrixXd(mass.bottomRightCorner(3, 3)),
            Eigen::MatrixXd(3.5 * Eigen::Matrix3d::Identity()));
  EXPECT_EQ(spatial.f.tail(3).norm(), 0);
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(9, 9);
  const std::vector<Index> to = {0, 1, 3, 4, 6, 7};
  for (Index k = 0; k < 6; ++k) h.block(0, to[k], 6, 1) = dense(planar.H).col(k);
  for (Index contact = 0; contact < 3; ++contact) h(6 + contact, 3 * contact + 2) = 1;
  EXPECT_EQ(dense(spatial.H), h);
  EXPECT_TRUE(spatial.G.empty());
}

TEST(Embedding, of_one_velocity_and_of_none) {
  RandomData random(55);
  const auto one = testing::random_global<GlobalProblem>(random, 1, 2, 1, 0);
  const GlobalProblem spatial = embed(one);
  validate(spatial);
  EXPECT_EQ(dense(spatial.M), Eigen::MatrixXd(dense(one.M)(0, 0) * Eigen::Matrix2d::Identity()));
  GlobalProblem none;
  none.spacedim = 2;
  none.M =
      Matrix{.storage = Storage::csr, .rows = 0, .cols = 0, .p = {0}, .i = {}, .x = {}, .info = {}};
  none.H =
      Matrix{.storage = Storage::csr, .rows = 0, .cols = 2, .p = {0}, .i = {}, .x = {}, .info = {}};
  none.w = Vector::Ones(2);
  none.mu = Vector::Ones(1);
  validate(none);
  const GlobalProblem still = embed(none);
  validate(still);
  EXPECT_EQ(still.M.rows, 0);
  EXPECT_EQ(still.w, Eigen::Vector3d(1, 1, 0));
}

TEST(Embedding, the_mean_mass_is_that_of_the_diagonal) {
  RandomData random(56);
  const auto planar = testing::random_global<GlobalProblem>(random, 6, 2, 2, 1);
  const Eigen::MatrixXd mass = dense(embed(planar).M);
  EXPECT_NEAR(mass(7, 7), dense(planar.M).trace() / 6, 1e-14);
  EXPECT_EQ(mass(6, 7), 0);
}

TEST(Embedding, refuses_what_is_not_planar) {
  RandomData random(48);
  const auto spatial = testing::random_local<LocalProblem>(random, 3, 1, 0);
  const std::string message = error_of(ErrorKind::unsuitable, [&] { embed(spatial); });
  EXPECT_TRUE(says(message, "/fclib_local/spacedim: is 3, the problem is not planar"));
  const auto planar = testing::random_local<LocalProblem>(random, 2, 1, 0);
  Solution wrong;
  wrong.r = Vector::Zero(3);
  EXPECT_THROW(embed(wrong, planar), Error);
  wrong.r = Vector::Zero(2);
  EXPECT_THROW(flatten(wrong, planar), Error);
}

TEST(Units, every_member_of_a_local_problem_changes_by_its_own) {
  RandomData random(49);
  auto problem = testing::random_local<LocalRollingProblem>(random, 5, 2, 2);
  problem.W.info = MatrixInfo{.comment = "of the old units"};
  const Scaling scaling{.velocity = 2, .impulse = 3, .length = 5};
  const LocalRollingProblem other = scaled(problem, scaling);
  Vector lever(10);
  lever << 1, 1, 1, 5, 5, 1, 1, 1, 5, 5;
  const Eigen::MatrixXd inverse = lever.cwiseInverse().asDiagonal();
  EXPECT_LT((dense(other.W) - 2.0 / 3 * inverse * dense(problem.W) * inverse).norm(), 1e-14);
  EXPECT_LT((dense(other.V) - 2.0 / 3 * inverse * dense(problem.V)).norm(), 1e-14);
  EXPECT_LT((dense(other.R) - 2.0 / 3 * dense(problem.R)).norm(), 1e-14);
  EXPECT_LT((other.q - 2 * inverse * problem.q).norm(), 1e-14);
  EXPECT_LT((other.s - 2 * problem.s).norm(), 1e-14);
  EXPECT_EQ(other.mu, problem.mu);
  EXPECT_LT((other.mu_r - 5 * problem.mu_r).norm(), 1e-14);
  EXPECT_FALSE(other.W.info.has_value());

  const Solution solution = testing::random_solution(random, problem, true, false);
  const Solution there = scaled(solution, problem, scaling);
  EXPECT_LT((there.r - 3 * lever.cwiseProduct(solution.r)).norm(), 1e-14);
  EXPECT_LT((there.u - 2 * inverse * solution.u).norm(), 1e-14);
  EXPECT_LT((there.l - 3 * solution.l).norm(), 1e-14);
  EXPECT_EQ(there.v.size(), 0);
  const LocalRollingProblem back = scaled(other, scaling.inverse());
  EXPECT_LT((dense(back.W) - dense(problem.W)).norm(), 1e-14);
  EXPECT_LT((back.mu_r - problem.mu_r).norm(), 1e-14);
}

TEST(Units, every_member_of_a_global_problem_changes_by_its_own) {
  RandomData random(50);
  const auto problem = testing::random_global<GlobalRollingProblem>(random, 7, 3, 2, 2);
  const Scaling scaling{.velocity = 2, .impulse = 3, .length = 5};
  const GlobalRollingProblem other = scaled(problem, scaling);
  Vector lever(6);
  lever << 1, 1, 5, 1, 1, 5;
  const Eigen::MatrixXd inverse = lever.cwiseInverse().asDiagonal();
  EXPECT_LT((dense(other.M) - 1.5 * dense(problem.M)).norm(), 1e-14);
  EXPECT_LT((dense(other.H) - dense(problem.H) * inverse).norm(), 1e-14);
  EXPECT_EQ(dense(other.G), dense(problem.G));
  EXPECT_LT((other.f - 3 * problem.f).norm(), 1e-14);
  EXPECT_LT((other.w - 2 * inverse * problem.w).norm(), 1e-14);
  EXPECT_LT((other.b - 2 * problem.b).norm(), 1e-14);
  const Solution solution = testing::random_solution(random, problem, true, true);
  EXPECT_LT((scaled(solution, problem, scaling).v - 2 * solution.v).norm(), 1e-14);
}

TEST(Units, without_rolling_friction_a_length_changes_nothing) {
  RandomData random(51);
  const auto problem = testing::random_local<LocalProblem>(random, 3, 2, 0);
  const LocalProblem other = scaled(problem, {.velocity = 1, .impulse = 1, .length = 7});
  EXPECT_EQ(dense(other.W), dense(problem.W));
  EXPECT_EQ(other.q, problem.q);
}

TEST(Units, the_scaled_error_is_the_same_in_all_of_velocity_and_impulse) {
  RandomData random(52);
  const auto problem = testing::random_local<LocalRollingProblem>(random, 5, 3, 0);
  const Solution solution = testing::random_solution(random, problem, false, false);
  const Scaling scaling{.velocity = 1e3, .impulse = 1e-5};
  const double before = merit(problem, solution).scaled_natural;
  const double after =
      merit(scaled(problem, scaling), scaled(solution, problem, scaling)).scaled_natural;
  EXPECT_NEAR(after / before, 1, 1e-12);
}

TEST(Units, a_factor_that_is_not_positive_is_refused) {
  RandomData random(53);
  const auto problem = testing::random_local<LocalProblem>(random, 3, 1, 0);
  Solution solution;
  solution.r = Vector::Zero(3);
  for (const double wrong : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    for (const Scaling& scaling :
         {Scaling{.velocity = wrong}, Scaling{.impulse = wrong}, Scaling{.length = wrong}}) {
      EXPECT_TRUE(says(error_of(ErrorKind::option, [&] { scaled(problem, scaling); }),
                       "is not a positive number"));
      EXPECT_TRUE(says(error_of(ErrorKind::option, [&] { scaled(solution, problem, scaling); }),
                       "is not a positive number"));
    }
  }
  solution.r = Vector::Zero(2);
  EXPECT_THROW(scaled(solution, problem, Scaling{}), Error);
}

TEST(Storage, has_names) {
  for (const auto storage : {Storage::csr, Storage::csc, Storage::triplet, Storage::dense}) {
    EXPECT_EQ(storage_of(name_of(storage)), storage);
  }
  EXPECT_EQ(name_of(Storage::csc), "csc");
  EXPECT_TRUE(says(error_of(ErrorKind::option, [] { storage_of("coo"); }),
                   "there is no storage 'coo'; there are: csr, csc, triplet, dense"));
}

TEST(Storage, of_all_matrices_of_a_problem_is_one) {
  RandomData random(54);
  const auto problem = testing::random_local<LocalProblem>(random, 3, 2, 2);
  for (const auto storage : {Storage::csr, Storage::csc, Storage::triplet, Storage::dense}) {
    const LocalProblem other = with_storage(problem, storage);
    for (const auto member : {&LocalProblem::W, &LocalProblem::V, &LocalProblem::R}) {
      EXPECT_EQ((other.*member).storage, storage);
      EXPECT_EQ(dense(other.*member), dense(problem.*member));
    }
  }
  const auto plain = testing::random_local<LocalProblem>(random, 3, 2, 0);
  EXPECT_EQ(with_storage(plain, Storage::dense).V, Matrix{});
}

TEST(Storage, a_matrix_too_large_to_be_dense_is_refused) {
  LocalProblem problem;
  problem.mu = Vector::Zero(20000);
  problem.q = Vector::Zero(60000);
  problem.W = Matrix{
      .storage = Storage::csr, .rows = 60000, .cols = 60000, .p = {}, .i = {}, .x = {}, .info = {}};
  problem.W.p.assign(60001, 0);
  EXPECT_TRUE(says(error_of(ErrorKind::unsuitable, [&] { with_storage(problem, Storage::dense); }),
                   "W: is 60000 x 60000, too large to be dense"));
  EXPECT_EQ(with_storage(problem, Storage::csc).W.storage, Storage::csc);
  // it is the product of both sizes that counts
  GlobalProblem wide;
  const auto zeros = [](Index rows, Index cols) {
    Matrix a{
        .storage = Storage::csr, .rows = rows, .cols = cols, .p = {}, .i = {}, .x = {}, .info = {}};
    a.p.assign(static_cast<std::size_t>(rows) + 1, 0);
    return a;
  };
  wide.M = zeros(2, 2);
  wide.H = zeros(2, 60000);
  EXPECT_EQ(with_storage(wide, Storage::dense).H.nnz(), 120000U);
  wide.M = zeros(1000, 1000);
  wide.H = zeros(1000, 2200002);
  EXPECT_TRUE(says(error_of(ErrorKind::unsuitable, [&] { with_storage(wide, Storage::dense); }),
                   "H: is 1000 x 2200002, too large to be dense"));
}

}  // namespace
}  // namespace fclib
