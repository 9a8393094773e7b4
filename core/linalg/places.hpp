// What the places, counts and triangles of a matrix must satisfy.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "linalg/matrix.hpp"

namespace fclib {

/// Throws Error (problem) if pointers, indices or sizes of a matrix contradict each other.
/// `validate` does the same and checks the values too. `where` names the matrix in the message.
void validate_places(const Matrix& a, const std::string& where);

/// Throws Error (problem) if there are values but the count of them (at `counter`) is missing. A
/// file or a C struct may have room for more entries than it counts, with anything in it. CSparse
/// gives an empty matrix room for one entry.
void require_counted(std::span<const double> x, std::size_t counted, const std::string& counter);

/// The symmetric matrix of which `a` has one triangle, with its diagonal: L + L^T - diag(L). Throws
/// Error (problem) if that makes no sense.
Matrix symmetric_of_triangle(const Matrix& a, const std::string& where);

}  // namespace fclib
