// Problems in other units. A velocity of 1 becomes `velocity`, an impulse of 1 becomes `impulse`
// and, with rolling or spin friction, a length of 1 becomes `length` (r_R and r_S are angular
// impulses, u_R and u_S angular velocities): with D = (1, ..., 1) and length for these components,
//
//   u' = velocity D^-1 u,  r' = impulse D r,  W' = velocity / impulse D^-1 W D^-1,  H' = H D^-1,
//
// The units that the fields state give the other rules. Solutions change with their problem. The
// natural-map error changes, because r - u^ adds the two; the scaled one does not.
#pragma once

#include <cmath>

#include "convert/arrange.hpp"
#include "problem.hpp"

namespace fclib {

struct Scaling {
  double velocity = 1;
  double impulse = 1;
  double length = 1;

  [[nodiscard]] Scaling inverse() const { return {1 / velocity, 1 / impulse, 1 / length}; }
};

namespace detail {

/// What one unit of a field becomes.
inline double factor(std::string_view unit, const Scaling& scaling) {
  if (unit == "m/s") return scaling.velocity;
  if (unit == "N s") return scaling.impulse;
  if (unit == "kg") return scaling.impulse / scaling.velocity;
  if (unit == "1/kg") return scaling.velocity / scaling.impulse;
  if (unit == "m") return scaling.length;
  return 1;
}

/// The factors of the components of all contacts: 1, and length for the angular ones.
template <class P>
Vector lever(const P& problem, const Scaling& scaling) {
  const Index d = problem.spacedim;
  Vector result = Vector::Ones(problem.size(Dim::m));
  const Index lengths = friction_of(problem).lengths(d);
  for (Index k = 0; k < static_cast<Index>(result.size()); ++k) {
    if (k % d >= lengths) result[k] = scaling.length;
  }
  return result;
}

inline void require_positive(const Scaling& scaling) {
  for (const double value : {scaling.velocity, scaling.impulse, scaling.length}) {
    if (!(value > 0) || !std::isfinite(value)) {
      throw Error(ErrorKind::option, std::to_string(value) + " is not a positive number",
                  "scaling");
    }
  }
}

}  // namespace detail

/// The problem in other units. Throws Error (option) if a factor is not positive.
template <class P>
P scaled(P problem, const Scaling& scaling) {
  detail::require_positive(scaling);
  const Vector lever = detail::lever(problem, scaling);
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    Member& member = problem.*field.member;
    const double factor = detail::factor(field.unit, scaling);
    if constexpr (std::same_as<Member, Vector>) {
      member *= factor;
      if (field.rows == Dim::m) member = member.cwiseQuotient(lever);
    } else if constexpr (std::same_as<Member, Matrix>) {
      if (member.empty()) return;
      const auto side = [&](Dim dim, Index k) { return dim == Dim::m ? lever[k] : 1.0; };
      std::size_t k = 0;  // entries are visited in the order in which they are stored
      Matrix& a = member;
      for_each_entry(Matrix(a), [&](Index row, Index col, double value) {
        a.x[k++] = factor * value / (side(field.rows, row) * side(field.cols, col));
      });
      a.info.reset();
    }
  });
  return problem;
}

/// The solution of the problem in other units; `problem` is in its own.
template <class P>
Solution scaled(Solution solution, const P& problem, const Scaling& scaling) {
  detail::require_positive(scaling);
  validate(solution, problem);
  const Vector lever = detail::lever(problem, scaling);
  for_each_field<Solution>([&](const Field<Solution, Vector>& field) {
    Vector& x = solution.*field.member;
    if (x.size() == 0) return;
    x *= detail::factor(field.unit, scaling);
    if (field.rows != Dim::m) return;
    // r is an impulse, u a velocity
    if (field.unit == "N s") {
      x = x.cwiseProduct(lever);
    } else {
      x = x.cwiseQuotient(lever);
    }
  });
  return solution;
}

}  // namespace fclib
