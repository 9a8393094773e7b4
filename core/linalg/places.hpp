#pragma once

#include <string>

#include "linalg/matrix.hpp"

namespace fclib {

/// Throws Error (problem) where pointers, indices or sizes of a matrix contradict each other, as
/// `validate` does, which looks at the values too; `where` names the matrix in the message.
void validate_places(const Matrix& a, const std::string& where);

}  // namespace fclib
