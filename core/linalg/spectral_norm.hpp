#pragma once

#include <Eigen/Core>

namespace fclib {

/// The spectral norm of the symmetric part of a small matrix.
double spectral_norm(const Eigen::MatrixXd& a);

}  // namespace fclib
