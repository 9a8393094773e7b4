#include "methods/pivoting.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>
#include <vector>

#include "reduced/scale.hpp"

namespace fclib {

namespace {

/// An entry of a column of the tableau that is smaller than this, relative to the largest, is
/// rounding.
constexpr double rounding = 1e-12;
/// Ratios that differ by less are equal.
constexpr double tie = 1e-13;

}  // namespace

template <class Cone>
Pivoting<Cone>::Pivoting(const ReducedProblem& problem, int edges) : problem_(problem) {
  const Eigen::Index nc = problem.nc();
  const Eigen::Index m = problem.m();
  // the corners of each group's disc, which is a segment if it has one component
  std::array<int, Cone::groups> corners;
  std::array<Eigen::Index, Cone::groups> first;  // corner of a group
  Eigen::Index of_contact = 0;
  for (int g = 0; g < Cone::groups; ++g) {
    corners[g] = Cone::size(g) == 1 ? 2 : edges;
    first[g] = of_contact;
    of_contact += corners[g];
  }
  const Eigen::Index sliding = nc * Cone::groups;
  const Eigen::Index reactions = nc + nc * of_contact;
  const Eigen::Index all = reactions + sliding;

  // if each contact has a unit of its own, the cones do not change
  const Vector unit = contact_weights(problem).cwiseSqrt().cwiseInverse();
  const Eigen::Index columns = 1 + of_contact;
  edges_ = Eigen::MatrixXd::Zero(m, columns);
  M_ = Eigen::MatrixXd::Zero(all, all);
  for (Index a = 0; a < nc; ++a) {
    edges_(D * a, 0) = unit[a];
    const Cone cone(problem.friction, a);
    for (int g = 0; g < Cone::groups; ++g) {
      const Eigen::Index slip = reactions + a * Cone::groups + g;
      M_(slip, a) = cone.coefficient(g);
      for (int k = 0; k < corners[g]; ++k) {
        const Eigen::Index at = nc + a * of_contact + first[g] + k;
        const double angle = 2 * std::numbers::pi * k / corners[g];
        const auto row = D * a + Cone::start(g);
        const Eigen::Index column = 1 + first[g] + k;
        edges_(row, column) = unit[a] * std::cos(angle);
        if (Cone::size(g) > 1) edges_(row + Cone::size(g) - 1, column) = unit[a] * std::sin(angle);
        M_(at, slip) = 1;
        M_(slip, at) = -1;
      }
    }
  }
  // B^T W B, block by block
  const auto edges_of = [&](Index a) { return edges_.template middleRows<D>(D * a); };
  Eigen::MatrixXd image(D, columns);
  Eigen::MatrixXd product(columns, columns);
  problem.W.template for_each_block<D>([&](Index a, Index b, const auto& w) {
    image = w.lazyProduct(edges_of(b));
    product = edges_of(a).transpose().lazyProduct(image);
    const Eigen::Index row = nc + a * of_contact;
    const Eigen::Index col = nc + b * of_contact;
    M_(a, b) = product(0, 0);
    M_.row(a).segment(col, of_contact) = product.row(0).tail(of_contact);
    M_.col(b).segment(row, of_contact) = product.col(0).tail(of_contact);
    M_.block(row, col, of_contact, of_contact) = product.bottomRightCorner(of_contact, of_contact);
  });
  Q_ = Vector::Zero(all);
  for (Index a = 0; a < nc; ++a) {
    const Vector own = edges_of(a).transpose() * problem.q.template segment<D>(D * a);
    Q_[a] = own[0];
    Q_.segment(nc + a * of_contact, of_contact) = own.tail(of_contact);
  }
}

template <class Cone>
double Pivoting<Cone>::bytes(const ReducedProblem& problem, int edges) {
  Eigen::Index unknowns = 1 + Cone::groups;  // of a contact
  for (int g = 0; g < Cone::groups; ++g) unknowns += Cone::size(g) == 1 ? 2 : edges;
  const auto n = static_cast<double>(problem.nc() * unknowns);
  return sizeof(double) * (n * n + n * (2 * n + 2));
}

template <class Cone>
int Pivoting<Cone>::solve(const Vector& cover, int most, FunctionRef<bool(int)> stop,
                          Vector& r) const {
  const Eigen::Index n = size();
  const double scale = Q_.template lpNorm<Eigen::Infinity>();
  r = Vector::Zero(problem_.m());
  if (!(scale > 0) || stop(0)) return 0;
  // variables: w of n rows, z of n rows, z0; w - M z - cover z0 = Q
  const Eigen::Index artificial = 2 * n;
  const Eigen::Index right = 2 * n + 1;
  Eigen::MatrixXd tableau(n, 2 * n + 2);
  tableau.leftCols(n).setIdentity();
  tableau.middleCols(n, n) = -M_;
  tableau.col(artificial) = -cover;
  tableau.col(right) = Q_ / scale;
  std::vector<Eigen::Index> basis(static_cast<std::size_t>(n));
  std::iota(basis.begin(), basis.end(), Eigen::Index{0});

  Eigen::Index row = 0;
  Q_.cwiseQuotient(cover).minCoeff(&row);
  Eigen::Index entering = artificial;
  Vector column(n);
  Eigen::RowVectorXd pivot(2 * n + 2);
  int pivots = 0;
  while (pivots < most) {
    ++pivots;
    pivot = tableau.row(row) / tableau(row, entering);
    column = tableau.col(entering);
    column[row] = 0;
    tableau.noalias() -= column * pivot;
    tableau.row(row) = pivot;
    tableau.col(entering).setZero();
    tableau(row, entering) = 1;
    const Eigen::Index leaving = std::exchange(basis[static_cast<std::size_t>(row)], entering);
    if (leaving == artificial) break;
    if (stop(pivots)) return pivots;
    entering = leaving < n ? leaving + n : leaving - n;

    // the ratio test; of equal ratios, that of z0 or else the one with the largest pivot
    column = tableau.col(entering);
    const double least = rounding * column.template lpNorm<Eigen::Infinity>();
    double smallest = std::numeric_limits<double>::infinity();
    for (Eigen::Index k = 0; k < n; ++k) {
      if (column[k] > least) smallest = std::min(smallest, tableau(k, right) / column[k]);
    }
    const double equal = smallest + tie * std::max(1.0, std::abs(smallest));
    row = -1;
    for (Eigen::Index k = 0; k < n; ++k) {
      if (!(column[k] > least) || !(tableau(k, right) / column[k] <= equal)) continue;
      if (basis[static_cast<std::size_t>(k)] == artificial) {
        row = k;
        break;
      }
      if (row < 0 || column[k] > column[row]) row = k;
    }
    if (row < 0) break;  // a ray
  }
  Vector x = Vector::Zero(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Index variable = basis[static_cast<std::size_t>(k)];
    if (variable >= n && variable < artificial) x[variable - n] = scale * tableau(k, right);
  }
  const Eigen::Index nc = problem_.nc();
  const Eigen::Index of_contact = edges_.cols() - 1;
  for (Index a = 0; a < nc; ++a) {
    const auto own = edges_.template middleRows<D>(D * a);
    r.template segment<D>(D * a) =
        own.col(0) * x[a] + own.rightCols(of_contact) * x.segment(nc + a * of_contact, of_contact);
  }
  return pivots;
}

#define FCLIB_INSTANTIATE(Cone) template class Pivoting<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
