// The structs of fclib.h beside those of the core.
//
// The members of a C struct have the names of the core's fields. Conversions loop over the fields,
// so that none of them names a member.
#pragma once

#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>

#include "problem.hpp"

// all else is hidden
#ifdef __GNUC__
#pragma GCC visibility push(default)
#endif
#include <fclib.h>
#ifdef __GNUC__
#pragma GCC visibility pop
#endif

/// The formulations by their names in C: each has the functions and the structs of its name.
#define FCLIB_FOR_EACH_KIND(of) \
  of(global) of(local) of(global_rolling) of(local_rolling) of(global_spin) of(local_spin)

namespace fclib::c {

template <class Struct, class Type>
struct Member {
  std::string_view name;
  Type Struct::* pointer;
};
// clang before 17 deduces no arguments of an aggregate by itself
template <class Struct, class Type>
Member(std::string_view, Type Struct::*) -> Member<Struct, Type>;

/// The core's struct for a C struct, and the members of the latter.
template <class Struct>
struct Twin;

#define MEMBER(name) \
  Member { #name, &C::name }

template <>
struct Twin<fclib_local> {
  using C = fclib_local;
  using Core = LocalProblem;
  static constexpr std::tuple members{MEMBER(spacedim), MEMBER(W),  MEMBER(V), MEMBER(R),
                                      MEMBER(q),        MEMBER(mu), MEMBER(s)};
};
template <>
struct Twin<fclib_local_rolling> {
  using C = fclib_local_rolling;
  using Core = LocalRollingProblem;
  static constexpr std::tuple members{MEMBER(spacedim), MEMBER(W),  MEMBER(V),    MEMBER(R),
                                      MEMBER(q),        MEMBER(mu), MEMBER(mu_r), MEMBER(s)};
};
template <>
struct Twin<fclib_global> {
  using C = fclib_global;
  using Core = GlobalProblem;
  static constexpr std::tuple members{MEMBER(spacedim), MEMBER(M), MEMBER(H),  MEMBER(G),
                                      MEMBER(f),        MEMBER(w), MEMBER(mu), MEMBER(b)};
};
template <>
struct Twin<fclib_global_rolling> {
  using C = fclib_global_rolling;
  using Core = GlobalRollingProblem;
  static constexpr std::tuple members{MEMBER(spacedim), MEMBER(M),    MEMBER(H),
                                      MEMBER(G),        MEMBER(f),    MEMBER(w),
                                      MEMBER(mu),       MEMBER(mu_r), MEMBER(b)};
};
template <>
struct Twin<fclib_local_spin> {
  using C = fclib_local_spin;
  using Core = LocalSpinProblem;
  static constexpr std::tuple members{MEMBER(spacedim), MEMBER(W),  MEMBER(V),    MEMBER(R),
                                      MEMBER(q),        MEMBER(mu), MEMBER(mu_s), MEMBER(mu_r),
                                      MEMBER(coupled),  MEMBER(s)};
};
template <>
struct Twin<fclib_global_spin> {
  using C = fclib_global_spin;
  using Core = GlobalSpinProblem;
  static constexpr std::tuple members{MEMBER(spacedim), MEMBER(M),       MEMBER(H),  MEMBER(G),
                                      MEMBER(f),        MEMBER(w),       MEMBER(mu), MEMBER(mu_s),
                                      MEMBER(mu_r),     MEMBER(coupled), MEMBER(b)};
};
template <>
struct Twin<fclib_solution> {
  using C = fclib_solution;
  using Core = Solution;
  static constexpr std::tuple members{MEMBER(v), MEMBER(u), MEMBER(r), MEMBER(l)};
};
template <>
struct Twin<fclib_info> {
  using C = fclib_info;
  using Core = ProblemInfo;
  static constexpr std::tuple members{MEMBER(title), MEMBER(description), MEMBER(math_info)};
};

#undef MEMBER

template <class C>
using CoreOf = typename Twin<C>::Core;

/// How a member of the core's structs looks in C.
template <class Type>
struct InC;
template <>
struct InC<Index> {
  using type = int;
};
template <>
struct InC<Matrix> {
  using type = fclib_matrix*;
};
template <>
struct InC<Vector> {
  using type = double*;
};
template <>
struct InC<std::string> {
  using type = char*;
};

/// Calls visit(field, member) for each field of the core's struct and its member of the C struct.
template <class C, class Visitor>
void for_each_member(const Visitor& visit) {
  using Core = CoreOf<C>;
  static_assert(std::tuple_size_v<decltype(Core::fields())> ==
                std::tuple_size_v<std::remove_cvref_t<decltype(Twin<C>::members)>>);
  for_each_field<Core>([&]<class Type>(const Field<Core, Type>& field) {
    const auto match = [&]<class CType>(const Member<C, CType>& member) {
      if constexpr (std::is_same_v<CType, typename InC<Type>::type>) {
        if (member.name == field.name) visit(field, member.pointer);
      }
    };
    std::apply([&](const auto&... member) { (match(member), ...); }, Twin<C>::members);
  });
}

}  // namespace fclib::c
