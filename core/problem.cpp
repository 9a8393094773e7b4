#include "problem.hpp"

#include <cmath>
#include <concepts>
#include <limits>

#include "number_text.hpp"

namespace fclib {

namespace detail {

void require_size(Index actual, Index expected, Dim dim, const Place& where, const char* what) {
  if (actual != expected) {
    throw Error(ErrorKind::problem,
                std::string("has ") + std::to_string(actual) + " " + what + ", expected " +
                    std::string(name_of(dim)) + " = " + std::to_string(expected),
                where);
  }
}

void validate_vector(const Vector& values, Index expected, Dim dim, Range range,
                     const Place& where) {
  require_size(static_cast<Index>(values.size()), expected, dim, where, "entries");
  const auto entry = [&](Eigen::Index k) { return where + "[" + std::to_string(k) + "]"; };
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    if (!std::isfinite(values[k])) {
      throw Error(ErrorKind::problem, "the value is not a finite number", entry(k));
    }
    if (range == Range::nonnegative && values[k] < 0) {
      throw Error(ErrorKind::problem, "is " + shortest(values[k]) + ", but must not be negative",
                  entry(k));
    }
  }
}

}  // namespace detail

template <class P>
void validate(const P& problem) {
  const auto [planar, spatial] = P::dimensions;
  if (problem.spacedim != planar && problem.spacedim != spatial) {
    throw Error(ErrorKind::problem,
                "is " + std::to_string(problem.spacedim) + ", but must be " +
                    std::to_string(planar) + " or " + std::to_string(spatial),
                place_of<P>("spacedim"));
  }
  if constexpr (P::spin) {
    if (problem.coupled != 0 && problem.coupled != 1) {
      throw Error(ErrorKind::problem,
                  "is " + std::to_string(problem.coupled) + ", but must be 0 or 1",
                  place_of<P>("coupled"));
    }
    if (problem.coupled == 1 && problem.spacedim != 4) {
      throw Error(ErrorKind::problem,
                  "is 1, but spacedim is " + std::to_string(problem.spacedim) +
                      ": only sliding and spin (spacedim 4) may be coupled",
                  place_of<P>("coupled"));
    }
  }
  if (problem.mu.size() > std::numeric_limits<Index>::max() / problem.spacedim) {
    throw Error(ErrorKind::problem, "has more contacts than can be numbered",
                place_of<P>("vectors/mu"));
  }
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    const Place where = place_of<P>(field);
    const Member& member = problem.*field.member;
    if constexpr (std::same_as<Member, Matrix>) {
      const bool absent = field.presence == Presence::mixed && !is_mixed(problem);
      if (absent && member.empty()) return;
      detail::require_size(member.rows, problem.size(field.rows), field.rows, where, "rows");
      detail::require_size(member.cols, problem.size(field.cols), field.cols, where, "columns");
      validate(member, where);
    } else if constexpr (std::same_as<Member, Vector>) {
      detail::validate_vector(member, problem.size(field.rows), field.rows, field.range, where);
    }
  });
}

template <class P>
void validate(const Solution& solution, const P& problem, const Place& where) {
  for_each_field<Solution>([&](const Field<Solution, Vector>& field) {
    const Vector& values = solution.*field.member;
    if (field.presence == Presence::optional && values.size() == 0) return;
    detail::validate_vector(values, problem.size(field.rows), field.rows, field.range,
                            where / field.name);
  });
}

#define FCLIB_INSTANTIATE(P)        \
  template void validate(const P&); \
  template void validate(const Solution&, const P&, const Place&);
FCLIB_FOR_EACH_FORMULATION(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
