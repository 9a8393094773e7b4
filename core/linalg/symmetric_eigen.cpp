#include "linalg/symmetric_eigen.hpp"

#include <Eigen/Eigenvalues>

namespace fclib {

double spectral_norm(const Eigen::MatrixXd& a) {
  const Eigen::MatrixXd symmetric = 0.5 * (a + a.transpose());
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(symmetric, Eigen::EigenvaluesOnly)
      .eigenvalues()
      .cwiseAbs()
      .maxCoeff();
}

Eigenpairs eigenpairs(const Eigen::MatrixXd& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(symmetric);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace fclib
