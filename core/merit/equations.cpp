#include "merit/equations.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>

#include "merit/natural_sums.hpp"

namespace fclib {

namespace {

using std::abs, std::copysign, std::sqrt;  // or those of Real

/// What rounding leaves of a sum, over the sizes of its terms: some roundings each. q has fewer
/// than v, u and l, which a solver has brought through conversions, and what is allowed to q is
/// hidden from the natural map.
constexpr Real rounding_unit = 32 * Real(std::numeric_limits<double>::epsilon());
constexpr Real rounding_unit_of_q = 4 * Real(std::numeric_limits<double>::epsilon());

template <class X>
RealVector product(const Matrix& a, const X& x) {
  RealVector y = RealVector::Zero(a.rows);
  for_each_entry(
      a, [&](Index row, Index col, double value) { y[row] += full_product(value, x[col]); });
  return y;
}

template <class X>
RealVector product_transposed(const Matrix& a, const X& x) {
  RealVector y = RealVector::Zero(a.cols);
  for_each_entry(
      a, [&](Index row, Index col, double value) { y[col] += full_product(value, x[row]); });
  return y;
}

/// |A| |x|: the sizes of what the product adds up.
template <class X>
RealVector sizes(const Matrix& a, const X& x) {
  RealVector y = RealVector::Zero(a.rows);
  for_each_entry(a, [&](Index row, Index col, double value) {
    y[row] += full_product(abs(value), abs(x[col]));
  });
  return y;
}

/// |A|^T |x|
template <class X>
RealVector sizes_transposed(const Matrix& a, const X& x) {
  RealVector y = RealVector::Zero(a.cols);
  for_each_entry(a, [&](Index row, Index col, double value) {
    y[col] += full_product(abs(value), abs(x[row]));
  });
  return y;
}

RealVector solved(const Factorization& mass, const RealVector& b) {
  return mass.solve(Vector(b.cast<double>())).cast<Real>();
}

/// M^-1 b, refined: the velocity that belongs to an impulse, not the one that rounding leaves.
RealVector solved_precisely(const GlobalProblem& problem, const Factorization& mass,
                            const RealVector& b) {
  RealVector x = solved(mass, b);
  for (int step = 0; step < 2; ++step) x += solved(mass, b - product(problem.M, x));
  return x;
}

/// Errors of these sizes with signs drawn at random (from the same seed every time), brought to
/// velocities by M^-1: a few of them say how errors spread, where |M^-1| would be dense.
class Spread {
 public:
  Spread(const Factorization& mass, const RealVector& size) {
    std::uint64_t state = 1;
    for (RealVector& velocity : velocities_) {
      RealVector signed_size = size;
      for (Real& value : signed_size) {
        state = state * 6364136223846793005U + 1442695040888963407U;
        if ((state >> 63U) != 0) value = -value;
      }
      velocity = solved(mass, signed_size);
    }
  }

  /// The root of the mean square of A^T x over these velocities x.
  [[nodiscard]] RealVector along(const Matrix& a) const {
    RealVector sum = RealVector::Zero(a.cols);
    for (const RealVector& velocity : velocities_) {
      sum += product_transposed(a, velocity).cwiseAbs2();
    }
    return (sum / Real(velocities_.size())).cwiseSqrt();
  }

 private:
  std::array<RealVector, 4> velocities_;
};

/// The norm of each contact's part of x, at each of its components.
RealVector contact_norms(const RealVector& x, Index d) {
  RealVector result(x.size());
  for (Eigen::Index at = 0; at < x.size(); at += d) {
    result.segment(at, d).setConstant(x.segment(at, d).norm());
  }
  return result;
}

/// Impulses that stop these velocities of the contacts, each alone.
RealVector stopping(const RealVector& velocity, const RealVector& scale, Index d) {
  RealVector result = contact_norms(velocity, d);
  for (Eigen::Index k = 0; k < result.size(); ++k) {
    const Real w = scale[k / d];
    result[k] = w > 0 ? result[k] / w : Real(0);
  }
  return result;
}

/// x over y by components, 0 where y is.
RealVector quotient(const RealVector& x, const RealVector& y) {
  RealVector result(x.size());
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    result[k] = y[k] != 0 ? abs(x[k] / y[k]) : Real(0);
  }
  return result;
}

Real root_mean_square(const RealVector& x) {
  return x.size() > 0 ? x.norm() / sqrt(Real(x.size())) : Real(0);
}

RealVector diagonal(const Matrix& a) {
  RealVector result = RealVector::Zero(a.rows);
  for_each_entry(a, [&](Index row, Index col, double value) {
    if (row == col) result[row] += value;
  });
  return result;
}

/// The part of a matrix that each row is coupled to, named by its first row.
std::vector<Index> coupled_parts(const Matrix& a) {
  std::vector<Index> part(static_cast<std::size_t>(a.rows));
  std::iota(part.begin(), part.end(), Index{0});
  const auto first = [&](Index row) {
    while (part[static_cast<std::size_t>(row)] != row) {
      Index& next = part[static_cast<std::size_t>(row)];
      row = next = part[static_cast<std::size_t>(next)];
    }
    return row;
  };
  for_each_entry(a, [&](Index row, Index col, double) {
    const Index one = first(row);
    const Index other = first(col);
    part[static_cast<std::size_t>(std::max(one, other))] = std::min(one, other);
  });
  for (Index row = 0; row < a.rows; ++row) part[static_cast<std::size_t>(row)] = first(row);
  return part;
}

/// What M v adds up, where v comes from the factors of M: |L| |L^T v| of M = L L^T, at most
/// sqrt(M_ii) || sqrt(M_jj) v_j || over the part of M that i is coupled to. In its own row |M| |v|
/// may be next to nothing, as at the joints of a robot in free flight.
RealVector momentum_sizes(const Matrix& mass, const std::vector<Index>& part, const RealVector& v) {
  const RealVector inertia = diagonal(mass).cwiseAbs();
  RealVector squares = RealVector::Zero(v.size());
  for (Eigen::Index k = 0; k < v.size(); ++k) {
    squares[part[static_cast<std::size_t>(k)]] += inertia[k] * v[k] * v[k];
  }
  RealVector result = sizes(mass, v);
  for (Eigen::Index k = 0; k < v.size(); ++k) {
    result[k] += sqrt(inertia[k] * squares[part[static_cast<std::size_t>(k)]]);
  }
  return result;
}

/// The mean of each d components.
template <class X>
RealVector mean_of_contacts(const X& x, Index d) {
  RealVector result = RealVector::Zero(x.size() / d);
  for (Eigen::Index k = 0; k < x.size(); ++k) result[k / d] += x[k] / d;
  return result;
}

/// rho of each contact, of the diagonal of W.
RealVector rho_of_contacts(const RealVector& diagonal, Index d) {
  RealVector result = mean_of_contacts(diagonal.cwiseAbs(), d);
  ContactScales<Real> scales;
  for (const Real& size : result) scales.add(size);
  for (Real& size : result) size = scales.rho(size);
  return result;
}

/// What is left of each component beyond its rounding.
RealVector beyond(const RealVector& x, const RealVector& rounding) {
  RealVector result(x.size());
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const Real left = abs(x[k]) - rounding[k];
    result[k] = left > 0 ? copysign(left, x[k]) : Real(0);
  }
  return result;
}

/// The component where `difference` is worst: `left` of it beyond rounding, over `scale`.
Mismatch worst(std::string_view part, const Vector& stored, const RealVector& difference,
               const RealVector& left, const RealVector& scale) {
  Mismatch result{.part = part};
  for (Eigen::Index k = 0; k < left.size(); ++k) {
    const Real size = abs(left[k]);
    const auto error = static_cast<double>(scale[k] > 0 ? size / scale[k] : size);
    if (k > 0 && !(error > result.error)) continue;
    result.index = static_cast<Index>(k);
    result.stored = stored[k];
    result.difference = static_cast<double>(difference[k]);
    result.error = error;
  }
  return result;
}

RealVector largest(const RealVector& x, const RealVector& y) {
  return x.cwiseAbs().cwiseMax(y.cwiseAbs());
}

}  // namespace

OwnSizes own_sizes(const LocalProblem& problem) {
  OwnSizes result;
  result.free_u = problem.q.cast<Real>();
  result.q = result.free_u.cwiseAbs();
  const RealVector of_W = diagonal(problem.W);
  result.scale = mean_of_contacts(of_W, problem.spacedim);
  result.rho = rho_of_contacts(of_W, problem.spacedim);
  if (!is_mixed(problem)) return result;
  result.l = quotient(problem.s.cast<Real>(), diagonal(problem.R));
  const RealVector moved = sizes(problem.V, result.l);
  result.q += moved;
  result.rounding = rounding_unit_of_q * moved;
  return result;
}

OwnSizes own_sizes(const GlobalProblem& problem, const Factorization& mass,
                   const LocalProblem* condensed) {
  const auto gram = [&](const Matrix& a, const Matrix& product) {
    return condensed != nullptr ? diagonal(product)
                                : RealVector(mass.gram_diagonal(to_eigen(a)).cast<Real>());
  };
  const Matrix none;
  OwnSizes result;
  result.free = solved(mass, problem.f.cast<Real>());
  const RealVector& free = result.free;
  result.part = coupled_parts(problem.M);
  RealVector impulse =
      momentum_sizes(problem.M, result.part, free) + problem.f.cast<Real>().cwiseAbs();
  if (is_mixed(problem)) {
    const RealVector velocity =
        sizes_transposed(problem.G, free) + problem.b.cast<Real>().cwiseAbs();
    result.l = quotient(velocity, gram(problem.G, condensed != nullptr ? condensed->R : none));
    impulse += sizes(problem.G, result.l);
  }
  result.free_u = product_transposed(problem.H, free);
  result.free_u += problem.w.cast<Real>();
  result.q = sizes_transposed(problem.H, free) + problem.w.cast<Real>().cwiseAbs();
  result.rounding = rounding_unit_of_q * (result.q + Spread(mass, impulse).along(problem.H));
  const RealVector of_W = gram(problem.H, condensed != nullptr ? condensed->W : none);
  result.scale = mean_of_contacts(of_W, problem.spacedim);
  result.rho = rho_of_contacts(of_W, problem.spacedim);
  return result;
}

Equations equations(const LocalProblem& problem, const Solution& solution, const OwnSizes& own) {
  const Index d = problem.spacedim;
  Equations result;
  const Vector& r = solution.r;

  // u = W r + V lambda + q
  result.u = product(problem.W, r);
  result.u += own.free_u;
  const RealVector stop =
      is_mixed(problem) || solution.u.size() > 0 ? stopping(own.q, own.scale, d) : RealVector();
  if (is_mixed(problem)) {
    const Vector& l = solution.l;
    const RealVector s = problem.s.cast<Real>();
    result.u += product(problem.V, l);
    // V^T r + R lambda + s = 0
    const RealVector residual = product_transposed(problem.V, r) + product(problem.R, l) + s;
    const RealVector parts = sizes_transposed(problem.V, r) + sizes(problem.R, l) + s.cwiseAbs();
    const RealVector velocity =
        sizes_transposed(problem.V, stop) + sizes(problem.R, own.l) + s.cwiseAbs();
    const RealVector least = RealVector::Constant(s.size(), root_mean_square(s));
    result.mismatches.push_back(worst("l", solution.l, residual,
                                      beyond(residual, rounding_unit * parts),
                                      largest(velocity, least)));
  }
  if (solution.u.size() > 0) {
    const RealVector difference = solution.u.cast<Real>() - result.u;
    RealVector terms = sizes(problem.W, r) + own.free_u.cwiseAbs();
    if (is_mixed(problem)) terms += sizes(problem.V, solution.l);
    const RealVector velocity =
        largest(contact_norms(sizes(problem.W, stop) + own.q, d), contact_norms(result.u, d));
    const RealVector least = RealVector::Constant(result.u.size(), root_mean_square(own.free_u));
    result.mismatches.push_back(worst("u", solution.u, difference,
                                      beyond(difference, rounding_unit * terms),
                                      largest(velocity, least)));
  }
  return result;
}

Equations equations(const GlobalProblem& problem, const Solution& solution,
                    const Factorization& mass, const OwnSizes& own) {
  const Index d = problem.spacedim;
  const bool mixed = is_mixed(problem);
  Equations result;
  const RealVector f = problem.f.cast<Real>();
  const RealVector w = problem.w.cast<Real>();
  const Vector& r = solution.r;
  const RealVector& free = own.free;

  // M v = H r + G lambda + f
  RealVector momentum = product(problem.H, r) + f;
  RealVector terms = sizes(problem.H, r) + f.cwiseAbs();
  if (mixed) {
    const Vector& l = solution.l;
    momentum += product(problem.G, l);
    terms += sizes(problem.G, l);
  }
  const bool given_v = solution.v.size() > 0;
  const RealVector v =
      given_v ? RealVector(solution.v.cast<Real>()) : solved_precisely(problem, mass, momentum);
  terms += momentum_sizes(problem.M, own.part, v);
  const RealVector fastest = largest(v, free);
  if (given_v) {
    const RealVector residual = product(problem.M, v) - momentum;
    const RealVector left = beyond(residual, rounding_unit * terms);
    Mismatch mismatch{.part = "v", .stored = v.size() > 0 ? solution.v[0] : 0};
    if (!left.isZero(0)) {
      RealVector stop = sizes(problem.H, stopping(own.q, own.scale, d));
      if (mixed) stop += sizes(problem.G, own.l);
      const RealVector velocity = largest(fastest, solved(mass, stop));
      const RealVector least = RealVector::Constant(
          v.size(), velocity.maxCoeff() * std::numeric_limits<double>::epsilon());
      mismatch = worst("v", solution.v, solved(mass, residual), solved(mass, left),
                       largest(velocity, least));
    }
    result.mismatches.push_back(mismatch);
  }

  // u = H^T v + w
  result.u = product_transposed(problem.H, v) + w;
  const bool given_u = solution.u.size() > 0;
  if (given_u) {
    const RealVector difference = solution.u.cast<Real>() - result.u;
    const RealVector parts = sizes_transposed(problem.H, fastest) + w.cwiseAbs();
    RealVector rounding = parts;
    if (!given_v) rounding += Spread(mass, terms).along(problem.H);
    const RealVector least = RealVector::Constant(result.u.size(), root_mean_square(own.free_u));
    result.mismatches.push_back(worst("u", solution.u, difference,
                                      beyond(difference, rounding_unit * rounding),
                                      largest(contact_norms(parts, d), least)));
  }

  // G^T v + b = 0
  if (mixed) {
    const RealVector b = problem.b.cast<Real>();
    const RealVector residual = product_transposed(problem.G, v) + b;
    const RealVector parts = sizes_transposed(problem.G, fastest) + b.cwiseAbs();
    RealVector rounding = parts;
    if (!beyond(residual, rounding_unit * parts).isZero(0)) {
      rounding += Spread(mass, terms).along(problem.G);  // the impulses are rounded too
    }
    result.mismatches.push_back(
        worst("l", solution.l, residual, beyond(residual, rounding_unit * rounding), parts));
  }
  return result;
}

}  // namespace fclib
