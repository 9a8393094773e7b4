// Small valid problems of every formulation and storage, to start from.
#pragma once

#include <functional>
#include <string>

#include "problem.hpp"

namespace fclib::fuzz {

template <class P>
P small_problem(Index d, Index nc, bool mixed, Storage storage) {
  P problem;
  problem.spacedim = d;
  problem.mu = Vector::Constant(nc, 0.5);
  const auto length = [&](Dim dim) -> Index {
    switch (dim) {
      case Dim::one:
        return 1;
      case Dim::n:
        return 4;
      case Dim::m:
        return d * nc;
      case Dim::p:
        return mixed ? 2 : 0;
      case Dim::nc:
        return nc;
      case Dim::nr:
        return d == 6 ? nc : 0;
    }
    return 0;
  };
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    if (field.presence == Presence::mixed && !mixed) return;
    if constexpr (std::is_same_v<Member, Matrix>) {
      // symmetric where it is square, by triplets
      Matrix a{.storage = Storage::triplet,
               .rows = length(field.rows),
               .cols = length(field.cols),
               .p = {},
               .i = {},
               .x = {},
               .info = {}};
      for (Index i = 0; i < a.rows; ++i) {
        for (Index j = 0; j < a.cols; ++j) {
          if (i != j && (i + j) % 3 != 0) continue;
          a.i.push_back(i);
          a.p.push_back(j);
          a.x.push_back(i == j ? 2.0 : 0.125);
        }
      }
      problem.*field.member = converted(a, storage);
    } else if constexpr (std::is_same_v<Member, Vector>) {
      problem.*field.member = Vector::LinSpaced(length(field.rows), 0.25, 1.0);
    }
  });
  problem.info = {.title = "small", .description = "for fuzzing", .math_info = "symmetric"};
  return problem;
}

/// Calls visit(name, problem) for small problems: each formulation, plain and mixed, planar and
/// spatial, in each storage.
template <class Visitor>
void for_each_small_problem(Visitor&& visit) {
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    for (const auto storage : {Storage::triplet, Storage::csc, Storage::csr, Storage::dense}) {
      for (const bool mixed : {false, true}) {
        // enough contacts in space that arrays are stored in chunks
        const bool planar = storage == Storage::triplet || storage == Storage::csr;
        const Index d = P::dimensions[planar ? 0 : 1];
        const std::string name = std::string(P::kind) + (mixed ? "-mixed-" : "-") +
                                 std::to_string(d) + "-" +
                                 std::to_string(static_cast<int>(storage));
        visit(name, small_problem<P>(d, planar ? 1 : 3, mixed, storage));
      }
    }
  });
}

/// The entries that the vectors of a solution have together.
template <class P>
std::int64_t length_of_solution(const P& problem) {
  std::int64_t length = 0;
  for_each_field<Solution>([&](const auto& field) { length += problem.size(field.rows); });
  return length;
}

/// A solution, or a guess, of the right sizes.
template <class P>
Solution small_solution(const P& problem) {
  Solution solution;
  for_each_field<Solution>([&](const auto& field) {
    solution.*field.member = Vector::Constant(problem.size(field.rows), 0.5);
  });
  return solution;
}

}  // namespace fclib::fuzz
