// Eigenvalues of small symmetric matrices. Eigen's solver is compiled here and nowhere else.
#pragma once

#include "linalg/matrix.hpp"

namespace fclib {

/// The spectral norm of the symmetric part of a small matrix.
double spectral_norm(const Eigen::MatrixXd& a);

/// The eigenvalues of a symmetric matrix, in increasing order, and its eigenvectors of length 1.
struct Eigenpairs {
  Vector values;
  Eigen::MatrixXd vectors;
};
Eigenpairs eigenpairs(const Eigen::MatrixXd& symmetric);

}  // namespace fclib
