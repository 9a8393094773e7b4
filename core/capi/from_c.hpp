// What a caller hands over, as structs of the core.
#pragma once

#include <string>

#include "capi/structs.hpp"
#include "io/hdf5/raw.hpp"

namespace fclib::c {

std::size_t size_of(int count, const Place& where);

/// Throws if triplets are more than nzmax, which programs for libfclib 3.1 may leave at 0.
void require_nzmax(const fclib_matrix& c, const Place& where);

Vector vector(const double* values, Index size, const Place& where);

/// The problem as it is. Only what its own sizes need is checked.
template <class C>
CoreOf<C> problem_as_given(const C& c);

/// The same without copies, for a write.
template <class C>
ProblemView view_as_given(const C& c);

/// Like problem_as_given(), but without the unused entries that nzmax counts. Callers validate it.
template <class C>
CoreOf<C> problem_of(const C& c);

/// The same, validated. Throws Error if it is not valid.
template <class C>
CoreOf<C> valid_problem(const C& c);

enum class Parts { some, any };

/// The solution of a problem. With Parts::some, v and u may be missing. With Parts::any, all may.
template <class P>
Solution solution_of(const fclib_solution& c, const P& problem, Parts parts);

}  // namespace fclib::c
