#include "reduced/own_units.hpp"

#include <algorithm>
#include <cmath>

#include "linalg/with_dimension.hpp"

namespace fclib {

OwnUnits::OwnUnits(const ReducedProblem& problem)
    : problem_(problem), unit_(problem.m()), friction_(problem.friction) {
  const int d = problem.d();
  const int moved = problem.friction.lengths(d);
  with_dimension(d, [&](auto dim) {
    for (Index a = 0; a < problem.nc(); ++a) {
      unit_.segment<dim>(Eigen::Index{dim} * a) = problem.W.diagonal_block<dim>(a).diagonal();
    }
  });
  const auto each_part = [&](const auto& visit) {
    for (Index a = 0; a < problem.nc(); ++a) {
      visit(0, unit_.segment(Eigen::Index{d} * a, moved));
      if (moved < d) visit(1, unit_.segment(Eigen::Index{d} * a + moved, d - moved));
    }
  };
  // the mean of each part; a part that is nothing beside the others gets the mean of those
  double largest[2] = {0, 0};
  each_part([&](int part, auto values) {
    values.setConstant(values.mean());
    largest[part] = std::max(largest[part], values[0]);
  });
  double sum[2] = {0, 0};
  double count[2] = {0, 0};
  each_part([&](int part, auto values) {
    if (!(values[0] > nothing_moves * largest[part])) return;
    sum[part] += values[0];
    ++count[part];
  });
  each_part([&](int part, auto values) {
    const double usual = count[part] > 0 ? sum[part] / count[part] : 1.0;
    values.setConstant(std::sqrt(values[0] > nothing_moves * largest[part] ? values[0] : usual));
  });
  inverse_ = unit_.cwiseInverse();
  q_ = problem.q.cwiseProduct(inverse_);
  if (const double size = q_.lpNorm<Eigen::Infinity>(); size > 0) size_ = size;
  q_ /= size_;
  for (Vector* const coefficients : {&friction_.mu_r, &friction_.mu_s}) {  // they are lengths
    for (Eigen::Index a = 0; a < coefficients->size(); ++a) {
      (*coefficients)[a] *= unit_[d * a + moved] * inverse_[d * a];
    }
  }
}

void OwnUnits::product(const Vector& r, const Vector& b, Vector& y, Workers* workers) const {
  problem_.W.multiply_add(r.cwiseProduct(inverse_), b.cwiseProduct(unit_), y, workers);
  y = y.cwiseProduct(inverse_);
}

}  // namespace fclib
