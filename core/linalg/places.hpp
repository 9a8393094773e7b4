// What a matrix's places, counts and triangles must be.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "linalg/matrix.hpp"

namespace fclib {

/// Throws Error (problem) where pointers, indices or sizes of a matrix contradict each other, as
/// `validate` does, which looks at the values too; `where` names the matrix in the message.
void validate_places(const Matrix& a, const std::string& where);

/// Throws Error (problem) where nothing is counted (what counts is at `counter`) though values are
/// there: then what counts them is missing. A file or a C struct may have room for more entries
/// than it counts, with anything in it; one place is the room that CSparse gives a matrix of none.
void require_counted(std::span<const double> x, std::size_t counted, const std::string& counter);

/// The symmetric matrix of which `a` has one triangle, with its diagonal: L + L^T - diag(L). Throws
/// Error (problem) where that makes no sense.
Matrix symmetric_of_triangle(const Matrix& a, const std::string& where);

}  // namespace fclib
