// What all formulations share: the union of them, their names and their validation.
#pragma once

#include <concepts>
#include <optional>
#include <string>
#include <type_traits>
#include <variant>

#include "error.hpp"
#include "field.hpp"
#include "formulations.hpp"  // generated from the files in problems/
#include "friction.hpp"
#include "place.hpp"
#include "solution.hpp"

namespace fclib {

namespace detail {
template <class Variant>
struct Pointers;
template <class... P>
struct Pointers<std::variant<P...>> {
  using type = std::variant<const P*...>;
};
}  // namespace detail

/// A problem of any formulation. Somebody else owns it.
using ProblemPointer = detail::Pointers<Problem>::type;

/// Calls visit(std::type_identity<P>) for each formulation P.
template <class Visitor>
constexpr void for_each_formulation(Visitor&& visit) {
  [&]<class... P>(std::type_identity<std::variant<P...>>) {
    (visit(std::type_identity<P>{}), ...);
  }(std::type_identity<Problem>{});
}

/// The HDF5 group of a formulation, "fclib_local" for the kind "local".
template <class P>
std::string group_name() {
  return "fclib_" + std::string(P::kind);
}

/// The path of a field inside its group: matrices are groups, vectors share "vectors".
template <class Struct>
std::string field_path(const Field<Struct, Matrix>& field) {
  return std::string(field.name);
}
template <class Struct>
std::string field_path(const Field<Struct, Index>& field) {
  return std::string(field.name);
}
template <class Struct>
std::string field_path(const Field<Struct, Vector>& field) {
  return "vectors/" + std::string(field.name);
}

/// The place of a member in the group of P, ...
template <class P>
Place place_of(std::string_view member) {
  return {"/fclib_", P::kind, "/", member};
}
/// ... and the place of a field, with the path of field_path().
template <class P, class Member>
Place place_of(const Field<P, Member>& field) {
  return {"/fclib_", P::kind, std::same_as<Member, Vector> ? "/vectors/" : "/", field.name};
}

/// The HDF5 group of a guess. The first guess is number 1.
inline std::string guess_path(std::size_t number) { return "/guesses/" + std::to_string(number); }

/// The number of contacts, from the sizes of the matrices. Throws Error (problem) if they are not a
/// multiple of d.
template <class P>
Index contact_count(const P& problem) {
  if (problem.spacedim < 1) {
    throw Error(ErrorKind::problem, "is " + std::to_string(problem.spacedim),
                place_of<P>("spacedim"));
  }
  std::optional<Index> count;
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    if constexpr (std::is_same_v<Member, Matrix>) {
      if (count || field.cols != Dim::m) return;
      const Index m = (problem.*field.member).cols;
      if (m < 0 || m % problem.spacedim != 0) {
        throw Error(ErrorKind::problem,
                    "has " + std::to_string(m) + " columns, which is no multiple of spacedim = " +
                        std::to_string(problem.spacedim),
                    place_of<P>(field));
      }
      count = m / problem.spacedim;
    }
  });
  return count.value_or(0);
}

/// Makes mu as long as there are contacts, and zero. All other vectors get their size from mu.
template <class P>
void count_contacts(P& problem) {
  problem.mu = Vector::Zero(contact_count(problem));
}

/// Whether the problem has bilateral constraints.
template <class P>
bool is_mixed(const P& problem) {
  return problem.size(Dim::p) > 0;
}

/// "3DFC", "M3DFC", "G2DFC", "GR3DFC", ...: the formulation, as in RT-0444. R stands for rolling, S
/// for spin, E for the ellipsoid of both.
template <class P>
std::string formulation(const P& problem) {
  std::string law;
  Index space = P::rolling ? (problem.spacedim + 1) / 2 : problem.spacedim;
  if constexpr (P::spin) {
    law = problem.coupled != 0 ? "E" : problem.spacedim == 6 ? "R" : "";
    space = 3;
  }
  return std::string(P::prefix) + law + (is_mixed(problem) ? "M" : "") + std::to_string(space) +
         "DFC";
}

/// The coefficients of friction of all contacts.
template <class P>
Friction friction_of(const P& problem) {
  Friction friction{.mu = problem.mu, .mu_r = {}, .mu_s = {}};
  if constexpr (requires { problem.mu_r; }) friction.mu_r = problem.mu_r;
  if constexpr (P::spin) {
    friction.mu_s = problem.mu_s;
    friction.coupled = problem.coupled != 0;
  }
  return friction;
}

/// Copies the contact law of a problem to one of another form: spacedim, the coefficients.
template <class To, class From>
void copy_law(const From& from, To& to) {
  for_each_field<To>([&]<class Member>(const Field<To, Member>& own) {
    for_each_field<From>([&]<class Other>(const Field<From, Other>& field) {
      if constexpr (std::is_same_v<Member, Other> && !std::is_same_v<Member, Matrix>) {
        const bool of_law =
            field.rows == Dim::one || field.rows == Dim::nc || field.rows == Dim::nr;
        if (field.name == own.name && of_law) to.*own.member = from.*field.member;
      }
    });
  });
}

namespace detail {
/// "global_rolling" and "local_rolling" have one law.
constexpr bool same_law(std::string_view global, std::string_view local) {
  constexpr std::string_view of_global = "global";
  constexpr std::string_view of_local = "local";
  return global.starts_with(of_global) && local.starts_with(of_local) &&
         global.substr(of_global.size()) == local.substr(of_local.size());
}
template <class P, class... Q>
consteval auto local_form(std::type_identity<std::variant<Q...>>) {
  constexpr std::size_t at = [] {
    std::size_t k = 0;
    for (const bool same : {same_law(P::kind, Q::kind)...}) {
      if (same) break;
      ++k;
    }
    return k;
  }();
  return std::type_identity<std::variant_alternative_t<at, std::variant<Q...>>>{};
}
}  // namespace detail

/// The local formulation with the law of a global one.
template <class P>
using LocalFormOf = typename decltype(detail::local_form<P>(std::type_identity<Problem>{}))::type;

namespace detail {
/// Throws Error (problem) if two sizes differ.
void require_size(Index actual, Index expected, Dim dim, const Place& where, const char* what);
/// Throws Error (problem) if a vector has another length than expected, or a value out of range.
void validate_vector(const Vector& values, Index expected, Dim dim, Range range,
                     const Place& where);
}  // namespace detail

/// Throws Error (problem) at the first fault in the data: a size that disagrees, an index out of
/// range, a value that is not finite, a negative coefficient of friction.
template <class P>
void validate(const P& problem);

/// Throws Error (problem) if the members of a solution do not fit the problem. Members that may be
/// absent (v and u, which follow from r) may be empty. `where` is its group in a file.
template <class P>
void validate(const Solution& solution, const P& problem, const Place& where = "/solution");

#define FCLIB_DECLARE(P)                   \
  extern template void validate(const P&); \
  extern template void validate(const Solution&, const P&, const Place&);
FCLIB_FOR_EACH_FORMULATION(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
