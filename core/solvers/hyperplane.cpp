// Hyperplane projection: a projection on K, a line search for a hyperplane that separates the
// iterate from the solutions, and a projection on both.
//
//   y = P_K(z_k - rho F(z_k)),  F(r) = u^, u = W r + q
//   x = z_k - alpha (z_k - y),  alpha = 1, 1/2, 1/4, ... the first with
//         F(x) . (z_k - y) >= sigma / rho ||z_k - y||^2
//   z_k+1 = P_{K and H}(z_k),  H = { s : F(x) . (s - x) <= 0 }
//
// Konnov, "Combined relaxation methods for finding equilibrium points and solving related problems"
// (1993); Solodov & Svaiter, "A new projection method for variational inequality problems" (1999);
// HP of Acary, Bremond, Huber, "On solving contact problems with Coulomb friction: formulations and
// numerical comparisons" (2018).
//
// Differs from the paper in: rho follows the line search, as Solodov & Svaiter advise: if the line
// search had to go back, rho is multiplied by alpha; if not, it grows. Velocities are interpolated
// between z_k and y, so that the line search costs no product with W and an iteration costs two.
// Each contact may have a step of its own (`metric`). If no hyperplane is found (F need not be
// monotone, and rounding may hide it), y is the next iterate. The last projection is that of
// Solodov & Svaiter. With `intersection` off it is that of Konnov and the paper, P_K of the
// projection on H; its steps are too short if contacts are open.

#include <utility>

#include "methods/projection_loops.hpp"
#include "reduced/with_cone.hpp"

namespace fclib::hyperplane {

namespace {

struct Options {
  Metric metric = Metric::contact;
  double rho = 1.0;
  double sigma = 0.3;
  double growth = 1.5;
  std::int64_t line_search = 50;
  bool intersection = true;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple{
        choice("metric", &O::metric, metrics, metric_doc),
        option("rho", &O::rho, "1/W_aa", {1e-12, 1e12}, "The first step of the first projection."),
        option("sigma", &O::sigma, "1", {1e-3, 0.999}, "How clearly the hyperplane must separate."),
        option("growth", &O::growth, "1", {1, 10},
               "rho is multiplied by this after a full step. With 1 it does not grow."),
        option("line_search", &O::line_search, "1", {1, 1000},
               "The largest number of halvings of alpha."),
        flag("intersection", &O::intersection,
             "The projection is on the cone and the half-space together. Else it is on one after "
             "the other."),
    };
  }
};

/// to.r = P_{K and H}(from), H = { s : f . (s - x) <= 0 }. It finds the root of the falling
/// function f . (P_K(from - lambda w f) - x) by false position (Illinois). `from_gap` = f . (from -
/// x) > 0. `lambda` is the root without a cone on entry. The root it found stays in to.r.
template <class Cone>
void project_on_both(const VariationalInequality<Cone>& vi, const Vector& from, const Vector& f,
                     const Vector& x, double from_gap, double lambda, VelocityPoint& to) {
  constexpr double accuracy = 1e-3;  // of the gap
  constexpr int max_projections = 40;
  const double level = f.dot(x);
  double low = 0;
  double low_gap = from_gap;
  double high = 0;
  double high_gap = 0;
  bool bracketed = false;
  for (int k = 0; k < max_projections; ++k) {
    vi.project(from, lambda, f, to);
    const double gap = f.dot(to.r) - level;
    if (std::abs(gap) <= accuracy * from_gap) return;
    if (gap > 0) {
      low = lambda;
      low_gap = gap;
      if (bracketed) high_gap *= 0.5;
    } else {
      high = lambda;
      high_gap = gap;
      low_gap *= bracketed ? 0.5 : 1.0;
      bracketed = true;
    }
    lambda = bracketed ? (low * high_gap - high * low_gap) / (high_gap - low_gap) : 4 * lambda;
  }
}

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, Iterates& iterates,
                const Vector& start) {
  constexpr double least = 1e-100;  // of rho
  constexpr double most = 1e100;
  constexpr double rounding = 1e-15;
  const VariationalInequality<Cone> vi(problem, options.metric);
  double rho = options.rho;
  VelocityPoint z = vi.point(start);
  VelocityPoint y = z;
  VelocityPoint x = z;
  vi.evaluate(z);
  if (const auto end = iterates.visit(0, z.r, [&] { return vi.error(z); })) return *end;

  for (std::int64_t k = 1;; ++k) {
    vi.project(z.r, rho, z.hat, y);
    vi.evaluate(y);
    const double enough = options.sigma / rho * vi.distance_squared(z.r, y.r);

    // near the solution the products below are only rounding: the plain projection continues
    if (enough <= rounding * z.hat.norm() * z.r.norm()) {
      std::swap(z, y);
      if (const auto end = iterates.visit(k, z.r, [&] { return vi.error(z); })) return *end;
      continue;
    }

    // F(x) . (z_k - y) for smaller and smaller alpha
    double alpha = 1;
    double separation = 0;
    for (std::int64_t halving = 0; halving <= options.line_search; ++halving) {
      if (halving > 0) alpha *= 0.5;
      x.u = z.u + alpha * (y.u - z.u);
      vi.modify(x);
      separation = x.hat.dot(z.r - y.r);
      if (separation >= enough) break;
    }

    const double norm = vi.velocity_squared(x.hat);
    if (separation >= enough && separation > 0 && norm > 0) {
      const double gap = alpha * separation;  // F(x) . (z_k - x)
      if (options.intersection) {
        x.r = z.r + alpha * (y.r - z.r);
        project_on_both(vi, z.r, x.hat, x.r, gap, gap / norm, y);
      } else {
        vi.project(z.r, gap / norm, x.hat, y);
      }
      vi.evaluate(y);
    }
    std::swap(z, y);
    rho = alpha < 1 ? std::max(rho * std::max(alpha, 0.5), least)
                    : std::min(rho * options.growth, most);
    if (const auto end = iterates.visit(k, z.r, [&] { return vi.error(z); })) return *end;
  }
}

}  // namespace

const Solver& solver() {
  static const Solver entry = projection_entry<Options>(
      "hyperplane", "Hyperplane projection", "Konnov 1993; Solodov & Svaiter 1999",
      [](const ReducedProblem& problem, const Options& options, Iterates& iterates,
         const Vector& start) {
        return with_cone(problem, [&]<class Cone>() {
          return iterate<Cone>(problem, options, iterates, start);
        });
      });
  return entry;
}

}  // namespace fclib::hyperplane
