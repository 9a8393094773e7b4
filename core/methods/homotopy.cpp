#include "methods/homotopy.hpp"

#include <algorithm>
#include <cmath>

#include "contact/inverse.hpp"
#include "reduced/relative_error.hpp"

namespace fclib {

template <class Cone>
Homotopy<Cone>::Homotopy(const ReducedProblem& problem, CoupledSystem& system)
    : problem_(problem), system_(system), units_(problem) {}

template <class Cone>
void Homotopy<Cone>::solve(const HomotopyRules& rules, Report report) {
  const auto stop_at = system_.factorisations() + rules.max_factorisations;
  rules_ = rules;
  start();
  double step = 0.3;  // of the arclength
  if (!linearise(r_, lambda_)) return;
  orient(true);
  while (system_.factorisations() < stop_at) {
    step = std::min(step, rules.stride / longest(r_, tangent_));
    int corrections = 0;
    for (;; step *= 0.5) {
      if (!(step > least_step) || system_.factorisations() >= stop_at) return;
      if (problem_.out_of_time()) return;
      next_ = r_ + step * tangent_;
      next_lambda_ = lambda_ + step * tangent_lambda_;
      corrections = correct(step);
      // det J and zeta change their signs together; if the angle says otherwise, the step skipped a
      // turn
      if (corrections > 0 && cosine() * sign_ * sign_at_start_ > rules_.cosine) break;
    }
    r_.swap(next_);
    lambda_ = next_lambda_;
    orient(false);
    if (lambda_ > 0.5) return;  // only a step that left the path does this
    if (corrections == 1) {
      step *= 2;
    } else if (corrections == 2) {
      step *= 1.3;
    } else if (corrections > 3) {
      step *= 0.6;
    }
    if (tell(report) || t() < rules.end) return;
  }
}

template <class Cone>
bool Homotopy<Cone>::tell(Report report) {
  physical_ = units_.reactions(r_);
  problem_.velocity(physical_, velocity_);
  return report(relative_error<Cone>(problem_, velocity_, physical_), physical_);
}

template <class Cone>
void Homotopy<Cone>::start() {
  const auto m = problem_.m();
  r_ = Vector::Zero(m);
  inverted_.resize(static_cast<std::size_t>(problem_.nc()));
  for (Index a = 0; a < problem_.nc(); ++a) r_[D * a] = 1;
  for (Vector* v : {&c_, &residual_, &derivative_, &next_, &tangent_, &across_, &along_})
    v->setZero(m);
  lambda_ = 0;
  tangent_lambda_ = -1;
  folds_ = 0;
  // F(r, 0) without c
  evaluate(r_, lambda_);
  c_ = residual_;
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Cone cone(units_.friction(), a);
    for_each_group<Cone>([&](auto group) {
      if (cone.coefficient(group) > 0) return;
      c_.template segment<Cone::size(group)>(D * a + Cone::start(group)).setZero();
    });
  }
}

template <class Cone>
bool Homotopy<Cone>::inside(const Vector& r) const {
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Cone cone(units_.friction(), a);
    if (!(r[D * a] > 0)) return false;
    bool within = true;
    for_each_group<Cone>([&](auto group) {
      const double mu = cone.coefficient(group);
      const auto part = r.template segment<Cone::size(group)>(D * a + Cone::start(group));
      within = within && !(mu > 0 && !(part.norm() < mu * r[D * a]));
    });
    if (!within) return false;
  }
  return true;
}

template <class Cone>
void Homotopy<Cone>::evaluate(const Vector& r, double lambda) {
  const double t = std::exp(lambda);
  const double s = 1 - t;
  const double e = rules_.smoothing;
  units_.product(r, units_.q(), residual_);
  std::vector<double>& blocks = system_.blocks();
  negative_ = false;
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Cone cone(units_.friction(), a);
    const auto at = D * a;
    Vec g = Vec::Zero();
    Vec dg = Vec::Zero();  // dg / dlambda
    Mat B = Mat::Zero();   // -t dg / dr
    bool any = false;
    for_each_group<Cone>([&](auto group) {
      constexpr int k = Cone::start(group);
      constexpr int T = Cone::size(group);
      const double mu = cone.coefficient(group);
      if (!(mu > 0)) {
        B.template block<T, T>(k, k).setIdentity();
        return;
      }
      any = true;
      const ContactVector<T> y = r.template segment<T>(at + k);
      const double x = mu * r[at];
      const double norm = y.norm();
      const double det = (x - norm) * (x + norm);
      const double w = det / x;
      const double h = std::sqrt(norm * norm + e * e * w * w);
      const double n = h - e * w;
      const double dn_dw = e * (e * w / h - 1);
      const double numerator = x - s * n;
      g[0] += mu * numerator / det;
      g.template segment<T>(k) -= y / det;
      dg[0] += mu * t * n / det;
      const double over = numerator / det;
      const double dn_dx = dn_dw * (1 + norm * norm / (x * x));
      B(0, 0) -= t * mu * mu * ((1 - s * dn_dx) - 2 * x * over) / det;
      B.template block<1, T>(0, k) =
          (-t * mu * (2 * over - s * (1 / h - 2 * dn_dw / x)) / det) * y.transpose();
      B.template block<T, 1>(k, 0) = (-t * mu * 2 * x / (det * det)) * y;
      B.template block<T, T>(k, k) = (2 * t / (det * det)) * y * y.transpose();
      for (int i = 0; i < T; ++i) B(k + i, k + i) += t / det;
    });
    if (!any) {
      g[0] = 1 / r[at];
      B(0, 0) = t / (r[at] * r[at]);
    }
    const Vec forcing = t * (g + c_.template segment<D>(at));
    residual_.template segment<D>(at) -= forcing;
    derivative_.template segment<D>(at) = -(forcing + t * dg);
    if (determinant<D>(B) < 0) negative_ = !negative_;
    Mat& inverted = inverted_[static_cast<std::size_t>(a)];
    inverted = inverse<D>(B);
    for_each_group<Cone>([&](auto group) {
      if (cone.coefficient(group) > 0) return;
      constexpr int k = Cone::start(group);
      constexpr int T = Cone::size(group);
      inverted.template middleRows<T>(k).setZero();
      inverted.template middleCols<T>(k).setZero();
    });
    Eigen::Map<Mat>(blocks.data() + std::ptrdiff_t{D * D} * a) =
        units_.template block<D>(a, inverted);
  }
}

template <class Cone>
bool Homotopy<Cone>::linearise(const Vector& r, double lambda) {
  evaluate(r, lambda);
  if (!system_.factorise()) return false;
  sign_ = system_.determinant_sign() * (negative_ ? -1 : 1);
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Mat& block = inverted_[static_cast<std::size_t>(a)];
    across_.template segment<D>(D * a) = -block * residual_.template segment<D>(D * a);
    along_.template segment<D>(D * a) = -block * derivative_.template segment<D>(D * a);
  }
  across_ = units_.divided(across_);
  system_.solve(across_);
  across_ = units_.multiplied(across_);
  along_ = units_.divided(along_);
  system_.solve(along_);
  along_ = units_.multiplied(along_);
  return across_.allFinite() && along_.allFinite();
}

template <class Cone>
double Homotopy<Cone>::product(const Vector& base, Index a, const Vector& x,
                               const Vector& y) const {
  const Cone cone(units_.friction(), a);
  const auto at = D * a;
  const double r = base[at];
  double sum = 0;
  bool any = false;
  for_each_group<Cone>([&](auto group) {
    constexpr int T = Cone::size(group);
    const double mu = cone.coefficient(group);
    if (!(mu > 0)) return;
    any = true;
    const auto k = at + Cone::start(group);
    const ContactVector<T> p = base.template segment<T>(k);
    const ContactVector<T> u = x.template segment<T>(k);
    const ContactVector<T> v = y.template segment<T>(k);
    const double norm = p.norm();
    const double det = (mu * r - norm) * (mu * r + norm);
    const double first = mu * mu * r * x[at] - p.dot(u);
    const double second = mu * mu * r * y[at] - p.dot(v);
    sum += 2 * first * second / (det * det) - (mu * mu * x[at] * y[at] - u.dot(v)) / det;
  });
  return any ? sum : x[at] * y[at] / (r * r);
}

template <class Cone>
double Homotopy<Cone>::product(const Vector& x, const Vector& y) const {
  double sum = 0;
  for (Index a = 0; a < problem_.nc(); ++a) sum += product(r_, a, x, y);
  return sum / static_cast<double>(problem_.nc());
}

template <class Cone>
double Homotopy<Cone>::longest(const Vector& base, const Vector& x) const {
  double largest = 0;
  for (Index a = 0; a < problem_.nc(); ++a) largest = std::max(largest, product(base, a, x, x));
  return std::sqrt(largest);
}

template <class Cone>
double Homotopy<Cone>::cosine() const {
  double aa = 1, bb = tangent_lambda_ * tangent_lambda_, ab = tangent_lambda_;
  const double nc = static_cast<double>(problem_.nc());
  for (Index a = 0; a < problem_.nc(); ++a) {
    aa += product(next_, a, along_, along_) / nc;
    bb += product(next_, a, tangent_, tangent_) / nc;
    ab += product(next_, a, along_, tangent_) / nc;
  }
  return -ab / std::sqrt(aa * bb);
}

template <class Cone>
void Homotopy<Cone>::orient(bool first) {
  const double norm = std::sqrt(product(along_, along_) + 1);
  if (first) sign_at_start_ = sign_;
  const double sign = -sign_ * sign_at_start_;
  if (!first && sign * tangent_lambda_ < 0) ++folds_;
  tangent_ = (sign / norm) * along_;
  tangent_lambda_ = sign / norm;
}

template <class Cone>
int Homotopy<Cone>::correct(double step) {
  constexpr int most = 5;
  // a step of this length may be wrong by a good part of itself, but no more
  const double reach = 0.7 * step * std::max(longest(r_, tangent_), 1.0);
  double last = 0;
  for (int k = 1; k <= most; ++k) {
    if (!inside(next_) || next_lambda_ < -60) return 0;
    if (!linearise(next_, next_lambda_)) return 0;
    const double dl = -product(tangent_, across_) / (tangent_lambda_ + product(tangent_, along_));
    across_ += dl * along_;
    const double size = std::max(longest(next_, across_), std::abs(dl));
    if (!std::isfinite(size)) return 0;
    if (size > (k == 1 ? std::max(reach, 0.2) : std::max(0.5 * last, rules_.accuracy))) return 0;
    next_ += across_;
    next_lambda_ += dl;
    last = size;
    if (size < rules_.accuracy) return inside(next_) ? k : 0;
  }
  return 0;
}

#define FCLIB_INSTANTIATE(Cone) template class Homotopy<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
