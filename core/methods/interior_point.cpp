#include "methods/interior_point.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "contact/inverse.hpp"
#include "methods/interior_path.hpp"
#include "reduced/relative_error.hpp"

namespace fclib {

template <int D>
InteriorPoint<D>::InteriorPoint(const ReducedProblem& problem, CoupledSystem& system)
    : problem_(problem), system_(system), units_(problem) {}

template <int D>
void InteriorPoint<D>::solve(const InteriorPointRules& rules, const Vector& guess,
                             FunctionRef<bool(double error, const Vector& r)> report) {
  start(rules, guess);
  iterations_ = follow_path(*this, rules, [&](int iteration) -> std::optional<double> {
    iterations_ = iteration;
    physical_ = units_.reactions(r_);
    velocity_ = units_.velocities(u_);
    const double error = relative_error<Cone>(problem_, velocity_, physical_);
    if (report(error, physical_)) return std::nullopt;
    return error;
  });
}

template <int D>
void InteriorPoint<D>::keep_predictor() {
  affine_x_ = dx_;
  affine_y_ = dy_;
}

template <int D>
double InteriorPoint<D>::gap(double step) const {
  return (x_ + step * dx_).dot(y_ + step * dy_) / static_cast<double>(problem_.nc());
}

template <int D>
void InteriorPoint<D>::advance(double step) {
  x_ += step * dx_;
  y_ += step * dy_;
  r_ += step * dr_;
  each([&](Index a) {  // x follows from r, to the last digit
    const double mu = problem_.friction.mu[a];
    x_.template segment<D>(D * a) = r_.template segment<D>(D * a);
    if (mu > 0) x_[D * a] *= mu;
  });
}

template <int D>
void InteriorPoint<D>::start(const InteriorPointRules& rules, const Vector& guess) {
  const auto m = problem_.m();
  for (Vector* v : {&g_, &lambda_, &dx_, &dy_, &dr_, &rhs_, &residual_vector_, &u_, &x_, &y_})
    v->setZero(m);
  scaling_.resize(static_cast<std::size_t>(problem_.nc()));
  r_ = units_.to_own(guess);
  units_.product(r_, units_.q(), u_);
  for (Index a = 0; a < problem_.nc(); ++a) {
    const double mu = problem_.friction.mu[a];
    const auto r = r_.template segment<D>(D * a);
    const auto u = u_.template segment<D>(D * a);
    Vec x = Vec::Zero();
    Vec y = Vec::Zero();
    if (mu > 0) {
      const double shift = rules.associated ? 0.0 : u.template tail<T>().norm();
      Vec z = r - u;
      z[0] = mu * r[0] - (u[0] / mu + shift);
      const double norm = z.template tail<T>().norm();
      const double high = interior::root(z[0] + norm, rules.tau);  // the spectral values of x
      const double low = interior::root(z[0] - norm, rules.tau);
      x[0] = 0.5 * (high + low);
      y[0] = 0.5 * rules.tau * (1 / high + 1 / low);
      if (norm > 0) {
        const ContactVector<T> along = z.template tail<T>() / norm;
        x.template tail<T>() = 0.5 * (high - low) * along;
        y.template tail<T>() = 0.5 * rules.tau * (1 / high - 1 / low) * along;
      }
    } else {
      x[0] = interior::root(r[0] - u[0], rules.tau);
      y[0] = rules.tau / x[0];
    }
    x_.template segment<D>(D * a) = x;
    y_.template segment<D>(D * a) = y;
    if (mu > 0) x[0] /= mu;
    r_.template segment<D>(D * a) = x;
  }
}

template <int D>
void InteriorPoint<D>::evaluate(const InteriorPointRules& rules) {
  units_.product(r_, units_.q(), u_, system_.workers());
  tau_ = x_.dot(y_) / static_cast<double>(problem_.nc());
  width_ = rules.smoothing * tau_;
  residual_ = largest([&](Index a) {
    const double mu = problem_.friction.mu[a];
    const Vec y = y_.template segment<D>(D * a);
    Vec residual = u_.template segment<D>(D * a);
    if (mu > 0) {
      residual -= y;
      residual[0] += y[0] - mu * y[0];
      if (!rules.associated) residual[0] += mu * sliding(y.template tail<T>().norm());
    } else {
      residual[0] -= y[0];
      residual.template tail<T>().setZero();
    }
    residual_vector_.template segment<D>(D * a) = residual;
    return residual.template lpNorm<Eigen::Infinity>();
  });
}

template <int D>
auto InteriorPoint<D>::scaled_target(Index a) const -> Vec {
  const double mu = problem_.friction.mu[a];
  Vec v = scaling_[static_cast<std::size_t>(a)].cone.N * g_.template segment<D>(D * a);
  if (mu > 0) v[0] /= mu;
  return v;
}

template <int D>
bool InteriorPoint<D>::assemble(double delta, const InteriorPointRules& rules) {
  std::vector<double>& blocks = system_.blocks();
  each([&](Index a) {
    const double mu = problem_.friction.mu[a];
    Scaling& s = scaling_[static_cast<std::size_t>(a)];
    const Vec x = x_.template segment<D>(D * a);
    const Vec y = y_.template segment<D>(D * a);
    Mat d0 = Mat::Zero();
    s.P.setIdentity();
    if (mu > 0) {
      s.cone.set(x, y);
      const Vec& w = s.cone.w;
      Mat n2 = 2 * w * w.transpose();
      n2(0, 0) -= 1;
      for (int k = 1; k < D; ++k) n2(k, k) += 1;
      n2 *= s.cone.beta * s.cone.beta;
      if (!rules.associated) {
        const double norm = y.template tail<T>().norm();
        if (norm > 0) {
          s.P.template block<1, T>(0, 1) =
              mu * y.template tail<T>().transpose() / std::hypot(norm, width_);
        }
      }
      n2.row(0) /= mu;
      n2.col(0) /= mu;
      d0 = n2 * s.P;
      lambda_.template segment<D>(D * a) = s.cone.N * y;
    } else {
      s.cone.N.setZero();
      s.cone.N(0, 0) = std::sqrt(x[0] / y[0]);
      d0(0, 0) = x[0] / y[0];
      lambda_[D * a] = s.cone.N(0, 0) * y[0];
    }
    s.D0 = d0;
    const Mat regular = Mat::Identity() + delta * d0;
    s.regular = inverse<D>(regular);
    Eigen::Map<Mat>(blocks.data() + std::ptrdiff_t{D * D} * a) =
        units_.template block<D>(a, s.regular * d0);
  });
  return system_.factorise();
}

template <int D>
void InteriorPoint<D>::correct(double sigma, bool second_order) {
  each([&](Index a) {
    const double mu = problem_.friction.mu[a];
    const Scaling& s = scaling_[static_cast<std::size_t>(a)];
    const Vec lambda = lambda_.template segment<D>(D * a);
    if (!(mu > 0)) {
      double target = sigma * tau_;
      if (second_order) target -= affine_x_[D * a] * affine_y_[D * a];
      g_[D * a] = -lambda[0] + target / lambda[0];
      return;
    }
    Vec target = Vec::Zero();
    target[0] = sigma * tau_;
    if (second_order) {
      lorentz::subtract_product<D>(s.cone.inverse * affine_x_.template segment<D>(D * a),
                                   s.cone.N * affine_y_.template segment<D>(D * a), target);
    }
    g_.template segment<D>(D * a) = lorentz::divide<D>(target, lambda) - lambda;
  });
}

template <int D>
void InteriorPoint<D>::correct_shift(double step) {
  each([&](Index a) {
    const auto y = y_.template segment<T>(D * a + 1);
    const double norm = y.norm();
    if (!(norm > 0)) return;
    const ContactVector<T> dy = step * affine_y_.template segment<T>(D * a + 1);
    residual_vector_[D * a] += problem_.friction.mu[a] * (sliding((y + dy).norm()) - sliding(norm) -
                                                          y.dot(dy) / std::hypot(norm, width_));
  });
}

template <int D>
bool InteriorPoint<D>::direction(double delta) {
  each([&](Index a) {
    const Scaling& s = scaling_[static_cast<std::size_t>(a)];
    dr_.template segment<D>(D * a) =
        s.regular * (scaled_target(a) - s.D0 * residual_vector_.template segment<D>(D * a));
  });
  dr_ = units_.divided(dr_);
  system_.solve(dr_, tau_ < interior::refined_tau);
  dr_ = units_.multiplied(dr_);
  if (!dr_.allFinite()) return false;
  units_.product(dr_, residual_vector_, rhs_, system_.workers());  // W dr + R
  rhs_ += delta * dr_;
  each([&](Index a) {
    const double mu = problem_.friction.mu[a];
    const Scaling& s = scaling_[static_cast<std::size_t>(a)];
    Vec dx = dr_.template segment<D>(D * a);
    Vec dy = s.P * rhs_.template segment<D>(D * a);
    if (mu > 0) {
      dx[0] *= mu;
      dy[0] /= mu;
    } else {
      dx.template tail<T>().setZero();
      dy.template tail<T>().setZero();
    }
    dx_.template segment<D>(D * a) = dx;
    dy_.template segment<D>(D * a) = dy;
  });
  return true;
}

template <int D>
double InteriorPoint<D>::longest() const {
  // the smallest of the steps at the contacts
  return -largest([&](Index a) {
    double step = std::numeric_limits<double>::infinity();
    if (problem_.friction.mu[a] > 0) {
      const auto leaves = [&](const Vector& v, const Vector& d) {
        return lorentz::longest<D>(v.template segment<D>(D * a), d.template segment<D>(D * a));
      };
      step = std::min({step, leaves(x_, dx_), leaves(y_, dy_)});
    } else {
      if (dx_[D * a] < 0) step = std::min(step, -x_[D * a] / dx_[D * a]);
      if (dy_[D * a] < 0) step = std::min(step, -y_[D * a] / dy_[D * a]);
    }
    return -step;
  });
}

template class InteriorPoint<2>;
template class InteriorPoint<3>;
template class InteriorPoint<4>;

}  // namespace fclib
