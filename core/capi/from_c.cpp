#include "capi/from_c.hpp"

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "capi/errors.hpp"
#include "linalg/places.hpp"

namespace fclib::c {

namespace {

template <class Number>
std::span<const Number> numbers(const Number* values, std::size_t size, const Place& where) {
  if (size == 0) return {};
  if (values == nullptr) fail(where, "is NULL, but has " + std::to_string(size) + " entries");
  return {values, size};
}

std::string text(const char* value) { return value != nullptr ? std::string(value) : absent_text; }

RawMatrixView view_of(const fclib_matrix& c, const Place& where) {
  RawMatrixView a;
  a.rows = c.m;
  a.cols = c.n;
  const std::size_t rows = size_of(c.m, where / "m");
  const std::size_t cols = size_of(c.n, where / "n");
  std::size_t entries = size_of(c.nzmax, where / "nzmax");
  if (c.nz >= 0) {
    a.storage = Storage::triplet;
    require_nzmax(c, where / "nz");
    entries = static_cast<std::size_t>(c.nz);
    a.p = numbers(c.p, entries, where / "p");
  } else if (c.nz == nz_csc || c.nz == nz_csr) {
    a.storage = c.nz == nz_csc ? Storage::csc : Storage::csr;
    a.p = numbers(c.p, (c.nz == nz_csc ? cols : rows) + 1, where / "p");
  } else if (c.nz == nz_dense) {
    a.storage = Storage::dense;
    entries = rows * cols;
  } else {
    fail(where / "nz", std::to_string(c.nz) + " is no storage");
  }
  if (a.storage != Storage::dense) a.i = numbers(c.i, entries, where / "i");
  a.x = numbers(c.x, entries, where / "x");
  if (c.info != nullptr) {
    a.info = MatrixInfo{.comment = text(c.info->comment),
                        .conditioning = c.info->conditioning,
                        .determinant = c.info->determinant,
                        .rank = c.info->rank};
  }
  return a;
}

Matrix copy_of(const RawMatrixView& a) {
  return {.storage = a.storage,
          .rows = a.rows,
          .cols = a.cols,
          .p = {a.p.begin(), a.p.end()},
          .i = {a.i.begin(), a.i.end()},
          .x = {a.x.begin(), a.x.end()},
          .info = a.info};
}

/// The numbers and matrices of a problem, checked for what its own sizes need, and its mu with the
/// length that they give. `take` turns a C matrix into what the problem should have.
template <class C, class Take>
CoreOf<C> sizes_of(const C& c, const Take& take) {
  using P = CoreOf<C>;
  P problem;
  // the matrices give the lengths of the vectors
  std::optional<Place> there;
  std::optional<Place> missing;
  for_each_member<C>([&]<class Type, class Pointer>(const Field<P, Type>& field, Pointer member) {
    if constexpr (std::is_same_v<Type, Index>) {
      problem.*field.member = c.*member;
    } else if constexpr (std::is_same_v<Type, Matrix>) {
      const Place where = place_of<P>(field);
      if (field.presence == Presence::mixed) {
        (c.*member != nullptr ? there : missing) = where;
        if (c.*member == nullptr) return;
      }
      problem.*field.member = take(field, view_of(given(c.*member, where), where));
    }
  });
  if (there && missing) fail(*missing, "is NULL, but " + std::string(*there) + " is not");
  const auto [planar, spatial] = P::dimensions;
  if (c.spacedim != planar && c.spacedim != spatial) {
    fail(place_of<P>("spacedim"), "is " + std::to_string(c.spacedim) + ", but must be " +
                                      std::to_string(planar) + " or " + std::to_string(spatial));
  }
  count_contacts(problem);
  return problem;
}

template <class C>
ProblemInfo info_of(const C& c) {
  ProblemInfo info{absent_group, absent_group, absent_group};
  if (c.info != nullptr) {
    for_each_member<fclib_info>([&](const auto& field, char* fclib_info::* member) {
      info.*field.member = text(c.info->*member);
    });
  }
  return info;
}

}  // namespace

std::size_t size_of(int count, const Place& where) {
  if (count < 0) fail(where, "is " + std::to_string(count) + ", but must not be negative");
  return static_cast<std::size_t>(count);
}

void require_nzmax(const fclib_matrix& c, const Place& where) {
  if (c.nzmax == 0 || c.nz <= c.nzmax) return;
  fail(where, std::to_string(c.nz) + " entries, more than nzmax, " + std::to_string(c.nzmax));
}

Vector vector(const double* values, Index size, const Place& where) {
  if (size == 0) return {};
  if (values == nullptr) fail(where, "is NULL, but has " + std::to_string(size) + " entries");
  return Eigen::Map<const Vector>(values, size);
}

template <class C>
CoreOf<C> problem_as_given(const C& c) {
  using P = CoreOf<C>;
  P problem = sizes_of(c, [](const auto&, const RawMatrixView& a) { return copy_of(a); });
  for_each_member<C>([&]<class Type, class Pointer>(const Field<P, Type>& field, Pointer member) {
    if constexpr (std::is_same_v<Type, Vector>) {
      problem.*field.member = vector(c.*member, problem.size(field.rows), place_of<P>(field));
    }
  });
  problem.info = info_of(c);
  return problem;
}

template <class C>
ProblemView view_as_given(const C& c) {
  using P = CoreOf<C>;
  std::vector<std::pair<std::string_view, RawMatrixView>> matrices;
  const P sizes = sizes_of(c, [&](const auto& field, const RawMatrixView& a) {
    matrices.emplace_back(field.name, a);
    return Matrix{.storage = a.storage, .rows = a.rows, .cols = a.cols};
  });
  ProblemView view{.kind = std::string(P::kind), .members = {}, .info = info_of(c), .geometry = {}};
  for_each_member<C>([&]<class Type, class Pointer>(const Field<P, Type>& field, Pointer member) {
    const bool written = field.presence != Presence::mixed || is_mixed(sizes);
    if constexpr (std::is_same_v<Type, Vector>) {
      const auto size = static_cast<std::size_t>(sizes.size(field.rows));
      const auto values = numbers<double>(c.*member, size, place_of<P>(field));
      const bool absent = field.presence == Presence::optional && size == 0;
      if (written && !absent) view.members.push_back({field.name, values});
    } else if constexpr (std::is_same_v<Type, Matrix>) {
      for (const auto& [name, a] : matrices) {
        const bool absent = field.presence != Presence::required && a.absent();
        if (name == field.name && written && !absent) view.members.push_back({name, a});
      }
    } else {
      view.members.push_back({field.name, sizes.*field.member});
    }
  });
  return view;
}

template <class C>
CoreOf<C> problem_of(const C& c) {
  using P = CoreOf<C>;
  P problem = problem_as_given(c);
  for_each_field<P>([&]<class Type>(const Field<P, Type>& field) {
    if constexpr (std::is_same_v<Type, Matrix>) {
      Matrix& a = problem.*field.member;
      const bool compressed = a.storage == Storage::csc || a.storage == Storage::csr;
      if (!compressed || a.p.empty() || a.p.back() < 0) return;
      const auto entries = static_cast<std::size_t>(a.p.back());
      require_counted(a.x, entries, place_of<P>(field) / "p");
      a.i.resize(std::min(a.i.size(), entries));
      a.x.resize(std::min(a.x.size(), entries));
    }
  });
  return problem;
}

template <class C>
CoreOf<C> valid_problem(const C& c) {
  CoreOf<C> problem = problem_of(c);
  validate(problem);
  return problem;
}

template <class P>
Solution solution_of(const fclib_solution& c, const P& problem, Parts parts) {
  Solution solution;
  for_each_member<fclib_solution>([&](const auto& field, double* fclib_solution::* member) {
    const bool optional = parts == Parts::any || field.presence == Presence::optional;
    if (optional && c.*member == nullptr) return;
    solution.*field.member =
        vector(c.*member, problem.size(field.rows), Place("/solution") / field.name);
  });
  return solution;
}

#define FCLIB_FROM_C(kind)                                             \
  template CoreOf<fclib_##kind> problem_as_given(const fclib_##kind&); \
  template ProblemView view_as_given(const fclib_##kind&);             \
  template CoreOf<fclib_##kind> problem_of(const fclib_##kind&);       \
  template CoreOf<fclib_##kind> valid_problem(const fclib_##kind&);    \
  template Solution solution_of(const fclib_solution&, const CoreOf<fclib_##kind>&, Parts);

FCLIB_FOR_EACH_KIND(FCLIB_FROM_C)

#undef FCLIB_FROM_C

}  // namespace fclib::c
