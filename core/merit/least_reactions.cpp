#include "merit/least_reactions.hpp"

#include <Eigen/IterativeLinearSolvers>
#include <algorithm>

#include "linalg/dependent_columns.hpp"

namespace fclib {

namespace {

/// Multiplications that a merit may spend on a dense factorisation: about a tenth of a second.
constexpr double dense_flops = 1e8;
/// If less than this share of a column is left beside the others, it is rounding, as in the
/// elimination of joints.
constexpr double dependent = 1e-12;
/// Conjugate gradients from zero stay among the smallest solutions, and grow towards the right one.
/// If they are stopped early, they explain less, and so less rounding is allowed.
constexpr double accuracy = 0.01;
constexpr int iterations = 300;

}  // namespace

Vector least_reactions(const SparseColumns& a, const RealVector& effect) {
  SparseColumns scaled = a;
  Vector lengths(a.cols());
  for (Eigen::Index col = 0; col < a.cols(); ++col) {
    const double length = a.col(col).norm();
    lengths[col] = length > 0 ? length : 1;
    scaled.col(col) /= lengths[col];
  }
  const Vector b = effect.cast<double>();
  const auto rows = static_cast<double>(a.rows());
  const auto cols = static_cast<double>(a.cols());
  Vector y;
  if (2 * rows * cols * std::min(rows, cols) <= dense_flops) {
    y = least_solution(Eigen::MatrixXd(scaled), b, dependent);
  } else {
    Eigen::LeastSquaresConjugateGradient<SparseColumns> gradients;
    gradients.setTolerance(accuracy);
    gradients.setMaxIterations(iterations);
    gradients.compute(scaled);
    y = gradients.solve(b);
  }
  return y.cwiseAbs().cwiseQuotient(lengths);
}

}  // namespace fclib
