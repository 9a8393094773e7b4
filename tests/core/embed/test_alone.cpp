#include "embed/alone.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <type_traits>
#include <vector>

#include "embed/rounding.hpp"
#include "embed/small_solver.hpp"

namespace fclib {
namespace {

/// Contacts without others, with numbers of all sizes, and now and then one that is special.
template <int D>
struct Contacts {
  int count;
  std::vector<double> W, q, mu, guess, r, u;

  Contacts(int number, unsigned seed, double part_special) : count(number) {
    std::mt19937_64 engine(seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform;
    const auto scale = [&](double most) {
      return std::pow(10.0, most * (2 * uniform(engine) - 1));
    };
    for (int k = 0; k < count; ++k) {
      const double size = k % 3 == 0 ? 1 : scale(k % 3 == 1 ? 2 : 120);
      double h[D][D];
      for (auto& row : h) {
        for (double& one : row) one = normal(engine);
      }
      const bool ball = uniform(engine) < 0.5;  // one step solves it
      for (int i = 0; i < D; ++i) {
        for (int j = 0; j < D; ++j) {
          double sum = 0;
          for (int l = 0; l < D; ++l) sum += h[i][l] * h[j][l];
          if (ball) sum = i != j ? 0 : i == 0 ? 1 : 3.5;
          W.push_back(size * sum);
        }
      }
      const double speed = k % 5 == 0 ? scale(120) : scale(2);
      for (int i = 0; i < D; ++i) {
        q.push_back(speed * normal(engine));
        guess.push_back(uniform(engine) < 0.3 ? 0 : scale(3) * speed / size * normal(engine));
      }
      mu.push_back(uniform(engine) < 0.2 ? 0 : scale(k % 4 == 0 ? 120 : 1));
    }
    constexpr double infinity = std::numeric_limits<double>::infinity();
    constexpr double special[] = {std::numeric_limits<double>::quiet_NaN(),
                                  infinity,
                                  -infinity,
                                  0.0,
                                  -0.0,
                                  std::numeric_limits<double>::denorm_min(),
                                  -1e-310,
                                  std::numeric_limits<double>::max(),
                                  -1.0,
                                  1e-300,
                                  1e200};
    for (auto* values : {&W, &q, &mu, &guess}) {
      for (double& one : *values) {
        if (uniform(engine) < part_special) one = special[engine() % std::size(special)];
      }
    }
    // none that touches another problem: a mark stays where nothing is written
    r.assign(q.size(), -7.25);
    u.assign(q.size(), -7.5);
  }

  LocalArrays arrays(bool guessed, bool velocities) {
    return {W.data(),  q.data(),
            mu.data(), guessed ? guess.data() : nullptr,
            r.data(),  velocities ? u.data() : nullptr};
  }
};

std::vector<std::uint64_t> bits(const std::vector<double>& values) {
  std::vector<std::uint64_t> result;
  for (const double one : values) result.push_back(std::bit_cast<std::uint64_t>(one));
  return result;
}

#ifdef FCLIB_AVX2
template <int D>
void compare() {
  int solved = 0;
  int left = 0;
  for (unsigned seed = 0; seed < 600; ++seed) {
    const int count = 1 + static_cast<int>(seed) % Alone::most;
    const double tolerance = std::pow(10.0, -1.0 - seed % 10);
    const bool guessed = seed % 2 == 0;
    const bool velocities = seed % 3 != 0;
    Contacts<D> here(count, seed, seed % 4 < 2 ? 0 : 0.03);
    Contacts<D> there = here;
    Alone a;
    Alone b;
    solve_alone_anywhere<D>(tolerance, count, here.arrays(guessed, velocities), a);
    solve_alone_avx2(std::integral_constant<int, D>(), tolerance, count,
                     there.arrays(guessed, velocities), b);
    ASSERT_EQ(a.solved, b.solved) << seed;
    ASSERT_EQ(bits(here.r), bits(there.r)) << seed;
    ASSERT_EQ(bits(here.u), bits(there.u)) << seed;
    for (unsigned k = 0; k < static_cast<unsigned>(count); ++k) {
      if ((a.solved >> k & 1U) == 0) {
        ++left;
        continue;
      }
      ++solved;
      ASSERT_EQ(std::bit_cast<std::uint64_t>(a.error[k]), std::bit_cast<std::uint64_t>(b.error[k]));
      ASSERT_EQ(a.steps[k], b.steps[k]);
    }
  }
  EXPECT_GT(solved, 2000);
  EXPECT_GT(left, 2000);
}

TEST(Alone, AllProcessorsFindTheSameDigits) {
  if (!has_avx2()) GTEST_SKIP() << "this processor has no AVX2";
  compare<2>();
  compare<3>();
}
#endif

/// Whether all that describes the contact has a value and a meaning.
template <int D>
bool is_valid(const Contacts<D>& contacts, int k, bool guessed) {
  const auto finite = [&](const std::vector<double>& values, int each) {
    const auto first = values.begin() + each * k;
    return std::all_of(first, first + each, [](double one) { return std::isfinite(one); });
  };
  const auto at = static_cast<std::size_t>(k);
  return finite(contacts.W, D * D) && finite(contacts.q, D) && finite(contacts.mu, 1) &&
         contacts.mu[at] >= 0 && (!guessed || finite(contacts.guess, D));
}

template <int D>
void check_answers() {
  int solved = 0;
  SmallSolver<D> judge;
  for (unsigned seed = 0; seed < 400; ++seed) {
    const int count = 1 + static_cast<int>(seed) % Alone::most;
    const double tolerance = std::pow(10.0, -1.0 - seed % 10);
    const bool guessed = seed % 2 == 0;
    Contacts<D> contacts(count, seed, seed % 4 < 2 ? 0 : 0.03);
    Alone found;
    solve_alone<D>(tolerance, count, contacts.arrays(guessed, true), found);
    EXPECT_EQ(found.solved >> (count - 1) >> 1, 0U) << "there are no others";
    for (int k = 0; k < count; ++k) {
      const auto at = static_cast<std::size_t>(k);
      double* const r = contacts.r.data() + D * at;
      double* const u = contacts.u.data() + D * at;
      if ((found.solved >> at & 1U) == 0) {
        for (int i = 0; i < D; ++i) {
          EXPECT_EQ(r[i], -7.25) << "what is not solved is not touched";
          EXPECT_EQ(u[i], -7.5);
        }
        continue;
      }
      ++solved;
      ASSERT_TRUE(is_valid(contacts, k, guessed)) << seed << ' ' << k;
      ASSERT_EQ(judge.take(1, contacts.W.data() + D * D * at, contacts.q.data() + D * at,
                           contacts.mu.data() + at),
                nullptr);
      double exact[D];
      const double error = judge.judge(r, exact);
      EXPECT_LE(error, found.error[at]) << seed << ' ' << k;
      EXPECT_LE(found.error[at], error + bounded_excess * tolerance) << seed << ' ' << k;
      EXPECT_LE(found.error[at], tolerance) << seed << ' ' << k;
    }
  }
  EXPECT_GT(solved, 1000);
}

TEST(Alone, WhatIsSolvedIsValidAndItsErrorIsABound) {
  check_answers<2>();
  check_answers<3>();
}

}  // namespace
}  // namespace fclib
