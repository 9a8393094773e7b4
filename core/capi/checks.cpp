// The functions of fclib.h that judge: validation and merits.
#include <cmath>
#include <limits>
#include <string>

#include "capi/errors.hpp"
#include "capi/from_c.hpp"
#include "merit/merit.hpp"
#include "merit/merit_1.hpp"
#include "proof/no_solution.hpp"

namespace fclib::c {

namespace {

template <class C>
int validate_problem(const C* c) {
  return guarded(0, [&] {
    valid_problem(given(c, "problem"));
    return 1;
  });
}

template <class C>
int validate_solution(const C* c, const fclib_solution* solution) {
  return guarded(0, [&] {
    const auto problem = problem_as_given(given(c, "problem"));
    validate(solution_of(given(solution, "solution"), problem, Parts::some), problem);
    return 1;
  });
}

template <class C>
double merit_of(const C* c, int kind, const fclib_solution* solution) {
  return guarded(std::numeric_limits<double>::quiet_NaN(), [&] {
    const auto problem = valid_problem(given(c, "problem"));
    const Solution candidate = solution_of(given(solution, "solution"), problem, Parts::some);
    switch (kind) {
      case MERIT_1:
        return merit_1(problem, candidate);
      case MERIT_2:
        return merit(problem, candidate).error;
    }
    fail("merit", std::to_string(kind) + " is no merit");
  });
}

template <class C>
double bound_of_certificate(const C* c, const double* y, const double* z) {
  return guarded(std::numeric_limits<double>::quiet_NaN(), [&] {
    const auto problem = valid_problem(given(c, "problem"));
    const Vector of_contacts = vector(y, problem.size(Dim::nc), "y");
    const Vector of_joints = z == nullptr ? Vector() : vector(z, problem.size(Dim::p), "z");
    for (const auto* part : {&of_contacts, &of_joints}) {
      const char* const name = part == &of_contacts ? "y" : "z";
      for (Eigen::Index k = 0; k < part->size(); ++k) {
        if (std::isfinite((*part)[k])) continue;
        fail(std::string(name) + "[" + std::to_string(k) + "]", "is not finite");
      }
    }
    return check_no_solution(problem, of_contacts, of_joints).bound;
  });
}

}  // namespace

}  // namespace fclib::c

using namespace fclib::c;

extern "C" {

#define FCLIB_FUNCTIONS_OF(kind)                                                                   \
  int fclib_validate_##kind(const fclib_##kind* problem) { return validate_problem(problem); }     \
  int fclib_validate_##kind##_solution(const fclib_##kind* problem,                                \
                                       const fclib_solution* solution) {                           \
    return validate_solution(problem, solution);                                                   \
  }                                                                                                \
  double fclib_merit_##kind(fclib_##kind* problem, fclib_merit merit, fclib_solution* solution) {  \
    return merit_of(problem, number_of(merit), solution);                                          \
  }                                                                                                \
  double fclib_certificate_##kind(const fclib_##kind* problem, const double* y, const double* z) { \
    return bound_of_certificate(problem, y, z);                                                    \
  }

FCLIB_FOR_EACH_KIND(FCLIB_FUNCTIONS_OF)

#undef FCLIB_FUNCTIONS_OF

}  // extern "C"
