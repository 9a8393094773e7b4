// What a caller hands over, as structs of the core.
#pragma once

#include <string>

#include "capi/structs.hpp"
#include "io/hdf5/raw.hpp"

namespace fclib::c {

std::size_t size_of(int count, const Place& where);

Vector vector(const double* values, Index size, const Place& where);

/// The problem as it is, unchecked but for what its own sizes need.
template <class C>
CoreOf<C> problem_as_given(const C& c);

/// The same without copies, to be written.
template <class C>
ProblemView view_as_given(const C& c);

/// As problem_as_given(), without the room that nzmax leaves, for who validates it.
template <class C>
CoreOf<C> problem_of(const C& c);

/// ... and valid.
template <class C>
CoreOf<C> valid_problem(const C& c);

enum class Parts { some, any };

/// The solution of a problem; with Parts::some v and u may be missing, with Parts::any all may.
template <class P>
Solution solution_of(const fclib_solution& c, const P& problem, Parts parts);

}  // namespace fclib::c
