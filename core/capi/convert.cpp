// The functions of fclib.h that convert: condensation, completion, Siconos' text.
#include <cstring>

#include "capi/errors.hpp"
#include "capi/from_c.hpp"
#include "capi/to_c.hpp"
#include "convert/complete.hpp"
#include "convert/condense.hpp"
#include "io/siconos/siconos.hpp"

namespace fclib::c {

namespace {

template <class C, class Global>
C* condensed(const Global* c) {
  return guarded<C*>(nullptr,
                     [&] { return to_c<C>(condense(valid_problem(given(c, "problem")))); });
}

template <class C>
int complete_solution(const C* c, fclib_solution* solution) {
  return guarded(0, [&] {
    const auto problem = valid_problem(given(c, "problem"));
    fclib_solution& target = given(solution, "solution");
    fclib_solution known = target;
    known.v = known.u = nullptr;
    const Solution all = complete(problem, solution_of(known, problem, Parts::some));
    const auto fill = [](double* to, const Vector& from) {
      if (to == nullptr || from.size() == 0) return;
      std::memcpy(to, from.data(), static_cast<std::size_t>(from.size()) * sizeof(double));
    };
    fill(target.v, all.v);
    fill(target.u, all.u);
    return 1;
  });
}

template <class C>
C* read_text(const char* path) {
  return guarded<C*>(nullptr, [&] {
    using P = CoreOf<C>;
    return to_c<C>(std::get<P>(read_siconos(&given(path, "path"), P::kind)));
  });
}

template <class C>
int write_text(const C* c, const char* path) {
  return guarded(0, [&] {
    const auto problem = valid_problem(given(c, "problem"));
    write_siconos(&given(path, "path"), &problem);
    return 1;
  });
}

}  // namespace

}  // namespace fclib::c

using namespace fclib::c;

extern "C" {

fclib_local* fclib_condense_global(const fclib_global* problem) {
  return condensed<fclib_local>(problem);
}

fclib_local_rolling* fclib_condense_global_rolling(const fclib_global_rolling* problem) {
  return condensed<fclib_local_rolling>(problem);
}

fclib_local_spin* fclib_condense_global_spin(const fclib_global_spin* problem) {
  return condensed<fclib_local_spin>(problem);
}

#define FCLIB_FUNCTIONS_OF(kind)                                                     \
  int fclib_complete_##kind(const fclib_##kind* problem, fclib_solution* solution) { \
    return complete_solution(problem, solution);                                     \
  }                                                                                  \
  fclib_##kind* fclib_read_siconos_##kind(const char* path) {                        \
    return read_text<fclib_##kind>(path);                                            \
  }                                                                                  \
  int fclib_write_siconos_##kind(const fclib_##kind* problem, const char* path) {    \
    return write_text(problem, path);                                                \
  }

FCLIB_FOR_EACH_KIND(FCLIB_FUNCTIONS_OF)

#undef FCLIB_FUNCTIONS_OF

}  // extern "C"
