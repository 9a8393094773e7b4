#include "reduced/scale.hpp"

#include <algorithm>

#include "linalg/with_dimension.hpp"

namespace fclib {

Vector mean_diagonals(const ReducedProblem& problem) {
  Vector result(problem.nc());
  with_dimension(problem.d(), [&](auto d) {
    for (Index a = 0; a < problem.nc(); ++a) {
      result[a] = problem.W.diagonal_block<d>(a).trace() / d;
    }
  });
  return result;
}

double mean_diagonal(const ReducedProblem& problem) {
  const auto count = static_cast<double>(problem.nc());
  double mean = 0;
  for (const double diagonal : mean_diagonals(problem)) mean += diagonal / count;
  return mean > 0 ? mean : 1.0;
}

Vector contact_weights(const ReducedProblem& problem) {
  Vector weight = mean_diagonals(problem);
  double sum = 0;
  for (const double value : weight) sum += std::max(0.0, value);
  const double mean = sum > 0 ? sum / static_cast<double>(problem.nc()) : 1.0;
  for (double& value : weight) {
    if (!(value > 0)) value = mean;
  }
  return weight;
}

}  // namespace fclib
