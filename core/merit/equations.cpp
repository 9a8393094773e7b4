#include "merit/equations.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "error_size.hpp"
#include "merit/least_reactions.hpp"
#include "merit/natural_sums.hpp"

namespace fclib {

namespace {

using std::abs, std::copysign, std::sqrt;  // or those of Real

/// The rounding of v, u and l, over the sizes of the terms they come from. It is some more
/// roundings than for q, since a solver has brought them through conversions.
constexpr Real rounding_unit = 32 * Real(std::numeric_limits<double>::epsilon());

template <class X>
RealVector product(const Matrix& a, const X& x) {
  RealVector y = RealVector::Zero(a.rows);
  for_each_entry(
      a, [&](Index row, Index col, double value) { y[row] += full_product(value, x[col]); });
  return y;
}

/// The sums of term(row, value) over the entries of each column of A.
template <class Term>
RealVector sums_of_columns(const Matrix& a, const Term& term) {
  RealVector y = RealVector::Zero(a.cols);
  if (a.storage == Storage::csc) {  // a sum that stays in the processor takes half the time
    for (Index col = 0; col < a.cols; ++col) {
      Real sum = 0;
      for (Index k = a.p[col]; k < a.p[col + 1]; ++k) sum += term(a.i[k], a.x[k]);
      y[col] = sum;
    }
  } else {
    for_each_entry(a, [&](Index row, Index col, double value) { y[col] += term(row, value); });
  }
  return y;
}

template <class X>
RealVector product_transposed(const Matrix& a, const X& x) {
  return sums_of_columns(a, [&](Index row, double value) { return full_product(value, x[row]); });
}

/// |A| |x|: the sizes of the terms that the product adds up.
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
  return sums_of_columns(
      a, [&](Index row, double value) { return full_product(abs(value), abs(x[row])); });
}

RealVector solved(const Factorization& mass, const RealVector& b) {
  return mass.solve(Vector(b.cast<double>())).cast<Real>();
}

/// M^-1 b, refined: the exact velocity of an impulse, without the rounding of one solve.
RealVector solved_precisely(const GlobalProblem& problem, const Factorization& mass,
                            const RealVector& b) {
  RealVector x = solved(mass, b);
  for (int step = 0; step < 2; ++step) x += solved(mass, b - product(problem.M, x));
  return x;
}

/// Errors of these sizes with random signs (from the same seed every time), turned into velocities
/// by M^-1. A few of them show how errors spread: |M^-1| would be dense.
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

/// The norm of each contact's part of x, repeated at each of its components.
RealVector contact_norms(const RealVector& x, Index d) {
  RealVector result(x.size());
  for (Eigen::Index at = 0; at < x.size(); at += d) {
    result.segment(at, d).setConstant(x.segment(at, d).norm());
  }
  return result;
}

/// Impulses that stop these velocities of the contacts, each alone; none is slower than `least`.
RealVector stopping(const RealVector& velocity, const RealVector& scale, Index d,
                    const Real& least = 0) {
  RealVector result = contact_norms(velocity, d);
  for (Eigen::Index k = 0; k < result.size(); ++k) {
    const Real w = scale[k / d];
    if (result[k] < least) result[k] = least;
    result[k] = w > 0 ? result[k] / w : Real(0);
  }
  return result;
}

/// x over y by components; 0 if y is 0.
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

/// The sizes of the terms of M v, if v comes from the factors of M. In its own row |M| |v| may be
/// next to nothing, as at the joints of a robot in free flight.
RealVector momentum_sizes(const Matrix& mass, const Factorization& factors, const RealVector& v) {
  return sizes(mass, v) + factors.terms(v.cast<double>()).cast<Real>();
}

/// Sizes of r and of lambda. The rounding of the equations is judged by them.
struct Sizes {
  RealVector r;
  RealVector l;
};

/// [A B]
SparseColumns beside(const Matrix& a, const Matrix& b) {
  const SparseColumns left = to_eigen(a);
  const SparseColumns right = to_eigen(b);
  SparseColumns result(left.rows(), left.cols() + right.cols());
  result.leftCols(left.cols()) = left;
  result.rightCols(right.cols()) = right;
  return result;
}

/// Both are at least as large as the data require.
Sizes explained(const Vector& least, Eigen::Index m, const Sizes& own) {
  Sizes result = own;
  for (Eigen::Index k = 0; k < least.size(); ++k) {
    Real& size = k < m ? result.r[k] : result.l[k - m];
    if (Real(least[k]) > size) size = least[k];
  }
  return result;
}

/// The sizes of the smallest reactions with the solution's H r + G lambda, or with its W r + V
/// lambda and V^T r + R lambda.
Sizes explained(const LocalProblem& problem, const Solution& solution, const Sizes& own) {
  const Eigen::Index m = problem.q.size();
  if (!is_mixed(problem)) {
    return explained(least_reactions(to_eigen(problem.W), product(problem.W, solution.r)), m, own);
  }
  const SparseColumns top = beside(problem.W, problem.V);
  const SparseColumns columns = to_eigen(problem.V);
  const SparseColumns rows = columns.transpose();
  const SparseColumns bottom = beside(Matrix::from_eigen(rows), problem.R);
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (const SparseColumns* part : {&top, &bottom}) {
    const Index below = part == &top ? 0 : static_cast<Index>(m);
    for (Eigen::Index col = 0; col < part->outerSize(); ++col) {
      for (SparseColumns::InnerIterator entry(*part, col); entry; ++entry) {
        entries.emplace_back(static_cast<Index>(entry.row()) + below, static_cast<Index>(col),
                             entry.value());
      }
    }
  }
  SparseColumns whole(top.cols(), top.cols());
  whole.setFromTriplets(entries.begin(), entries.end());
  RealVector effect(whole.rows());
  effect.head(m) = product(problem.W, solution.r) + product(problem.V, solution.l);
  effect.tail(effect.size() - m) =
      product_transposed(problem.V, solution.r) + product(problem.R, solution.l);
  return explained(least_reactions(whole, effect), m, own);
}
Sizes explained(const GlobalProblem& problem, const Factorization& mass, const Solution& solution,
                const Sizes& own) {
  SparseColumns columns = is_mixed(problem) ? beside(problem.H, problem.G) : to_eigen(problem.H);
  RealVector effect = product(problem.H, solution.r);
  if (is_mixed(problem)) effect += product(problem.G, solution.l);
  // as velocities, so that a light body counts as much as a heavy one
  SparseColumns impulse(effect.size(), 1);
  for (Eigen::Index k = 0; k < effect.size(); ++k) {
    impulse.insert(k, 0) = static_cast<double>(effect[k]);
  }
  const std::optional<SparseColumns> half = mass.half(columns);
  if (half) {
    columns = *half;
    effect = Vector(*mass.half(impulse)).cast<Real>();
  }
  return explained(least_reactions(columns, effect), problem.w.size(), own);
}

bool exact(const std::vector<Mismatch>& mismatches) {
  return std::all_of(mismatches.begin(), mismatches.end(),
                     [](const Mismatch& one) { return one.error == 0; });
}

/// The mean of each group of d components.
template <class X>
RealVector mean_of_contacts(const X& x, Index d) {
  RealVector result = RealVector::Zero(x.size() / d);
  for (Eigen::Index k = 0; k < x.size(); ++k) result[k / d] += x[k] / d;
  return result;
}

/// rho of each contact, from the diagonal of W.
RealVector rho_of_contacts(const RealVector& diagonal, Index d) {
  RealVector result = mean_of_contacts(diagonal.cwiseAbs(), d);
  ContactScales<Real> scales;
  for (const Real& size : result) scales.add(size);
  for (Real& size : result) size = scales.rho(size);
  return result;
}

/// The part of each component beyond its rounding.
RealVector beyond(const RealVector& x, const RealVector& rounding) {
  RealVector result(x.size());
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const Real left = abs(x[k]) - rounding[k];
    result[k] = left <= 0 ? Real(0) : copysign(left, x[k]);  // NaN stays NaN
  }
  return result;
}

/// The component with the worst `difference`: `left` is its part beyond rounding, over `scale`.
Mismatch worst(std::string_view part, const Vector& stored, const RealVector& difference,
               const RealVector& left, const RealVector& scale) {
  Mismatch result{.part = part};
  for (Eigen::Index k = 0; k < left.size(); ++k) {
    const Real size = abs(left[k]);
    const double error = error_size(scale[k] > 0 ? size / scale[k] : size);
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
  RealVector impulse = momentum_sizes(problem.M, mass, free) + problem.f.cast<Real>().cwiseAbs();
  if (is_mixed(problem)) {
    const RealVector velocity =
        sizes_transposed(problem.G, free) + problem.b.cast<Real>().cwiseAbs();
    const RealVector of_R = gram(problem.G, condensed != nullptr ? condensed->R : none);
    result.l = quotient(velocity, of_R);
    const RealVector s = product_transposed(problem.G, free) + problem.b.cast<Real>();
    result.least_joint = root_mean_square(s);
    result.least_l = quotient(RealVector::Constant(s.size(), result.least_joint), of_R);
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
  const bool mixed = is_mixed(problem);
  const bool given_u = solution.u.size() > 0;
  Equations result;
  const Vector& r = solution.r;

  // u = W r + V lambda + q
  result.u = product(problem.W, r);
  result.u += own.free_u;
  if (mixed) result.u += product(problem.V, solution.l);
  if (!mixed && !given_u) return result;
  const RealVector stop = stopping(own.q, own.scale, d);
  const RealVector s = mixed ? RealVector(problem.s.cast<Real>()) : RealVector();

  // the mismatches beyond the rounding of reactions of these sizes
  const auto judged = [&](const Sizes& known) {
    std::vector<Mismatch> found;
    if (mixed) {
      // V^T r + R lambda + s = 0
      const RealVector residual =
          product_transposed(problem.V, r) + product(problem.R, solution.l) + s;
      const RealVector parts =
          sizes_transposed(problem.V, known.r) + sizes(problem.R, known.l) + s.cwiseAbs();
      const RealVector velocity =
          sizes_transposed(problem.V, stop) + sizes(problem.R, own.l) + s.cwiseAbs();
      const RealVector least = RealVector::Constant(s.size(), root_mean_square(s));
      found.push_back(worst("l", solution.l, residual, beyond(residual, rounding_unit * parts),
                            largest(velocity, least)));
    }
    if (given_u) {
      const RealVector difference = solution.u.cast<Real>() - result.u;
      RealVector terms = sizes(problem.W, known.r) + own.free_u.cwiseAbs();
      if (mixed) terms += sizes(problem.V, known.l);
      const RealVector velocity =
          largest(contact_norms(sizes(problem.W, stop) + own.q, d), contact_norms(result.u, d));
      const RealVector least = RealVector::Constant(result.u.size(), root_mean_square(own.free_u));
      found.push_back(worst("u", solution.u, difference, beyond(difference, rounding_unit * terms),
                            largest(velocity, least)));
    }
    return found;
  };
  const Sizes own_reactions{stop, own.l};
  result.mismatches = judged(own_reactions);
  if (!exact(result.mismatches)) {
    result.mismatches = judged(explained(problem, solution, own_reactions));
  }
  return result;
}

Equations equations(const GlobalProblem& problem, const Solution& solution,
                    const Factorization& mass, const OwnSizes& own) {
  const Index d = problem.spacedim;
  const bool mixed = is_mixed(problem);
  const bool given_v = solution.v.size() > 0;
  const bool given_u = solution.u.size() > 0;
  Equations result;
  const RealVector f = problem.f.cast<Real>();
  const RealVector w = problem.w.cast<Real>();
  const Vector& r = solution.r;
  const RealVector& free = own.free;

  // M v = H r + G lambda + f
  RealVector momentum = product(problem.H, r) + f;
  if (mixed) momentum += product(problem.G, solution.l);
  const RealVector v =
      given_v ? RealVector(solution.v.cast<Real>()) : solved_precisely(problem, mass, momentum);
  const RealVector fastest = largest(v, free);
  // u = H^T v + w
  result.u = product_transposed(problem.H, v) + w;
  if (!given_v && !given_u && !mixed) return result;

  const RealVector stop = stopping(own.q, own.scale, d);
  const RealVector of_bodies = f.cwiseAbs() + momentum_sizes(problem.M, mass, v);

  // the mismatches beyond the rounding of reactions of these sizes
  const auto judged = [&](const Sizes& known) {
    std::vector<Mismatch> found;
    RealVector terms = of_bodies + sizes(problem.H, known.r);
    if (mixed) terms += sizes(problem.G, known.l);
    if (given_v) {
      const RealVector residual = product(problem.M, v) - momentum;
      const RealVector left = beyond(residual, rounding_unit * terms);
      Mismatch mismatch{.part = "v", .stored = v.size() > 0 ? solution.v[0] : 0};
      if (!left.isZero(0)) {
        // the velocity that a reaction gives a body next to nothing that moves is not 0
        const Real slowest = root_mean_square(own.free_u);
        RealVector impulse = sizes(problem.H, stopping(own.q, own.scale, d, slowest));
        if (mixed) impulse += sizes(problem.G, largest(own.l, own.least_l));
        const RealVector velocity = largest(fastest, solved(mass, impulse));
        const RealVector least = RealVector::Constant(
            v.size(), velocity.maxCoeff() * std::numeric_limits<double>::epsilon());
        mismatch = worst("v", solution.v, solved(mass, residual), solved(mass, left),
                         largest(velocity, least));
      }
      found.push_back(mismatch);
    }
    if (given_u) {
      const RealVector difference = solution.u.cast<Real>() - result.u;
      const RealVector parts = sizes_transposed(problem.H, fastest) + w.cwiseAbs();
      RealVector rounding = parts;
      if (!given_v) rounding += Spread(mass, terms).along(problem.H);
      const RealVector least = RealVector::Constant(result.u.size(), root_mean_square(own.free_u));
      found.push_back(worst("u", solution.u, difference,
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
      const RealVector least = RealVector::Constant(residual.size(), own.least_joint);
      found.push_back(worst("l", solution.l, residual, beyond(residual, rounding_unit * rounding),
                            largest(parts, least)));
    }
    return found;
  };
  const Sizes own_reactions{stop, own.l};
  result.mismatches = judged(own_reactions);
  if (!exact(result.mismatches)) {
    result.mismatches = judged(explained(problem, mass, solution, own_reactions));
  }
  return result;
}

}  // namespace fclib
