#include "linalg/spectral_norm.hpp"

#include <Eigen/Eigenvalues>

namespace fclib {

double spectral_norm(const Eigen::MatrixXd& a) {
  const Eigen::MatrixXd symmetric = 0.5 * (a + a.transpose());
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(symmetric, Eigen::EigenvaluesOnly)
      .eigenvalues()
      .cwiseAbs()
      .maxCoeff();
}

}  // namespace fclib
