#include "methods/rolling_interior_point.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "contact/inverse.hpp"
#include "methods/interior_path.hpp"
#include "reduced/relative_error.hpp"

namespace fclib {

template <int D>
RollingInteriorPoint<D>::RollingInteriorPoint(const ReducedProblem& problem, CoupledSystem& system)
    : problem_(problem), system_(system), units_(problem) {
  contacts_.resize(static_cast<std::size_t>(problem.nc()));
  for (Index a = 0; a < problem.nc(); ++a) {
    auto& groups = contacts_[static_cast<std::size_t>(a)].groups;
    groups[0].coefficient = units_.friction().mu[a];
    groups[1].coefficient = units_.friction().mu_r[a];
    for (Group& group : groups) group.tail = group.coefficient > 0;
    if (!groups[0].tail && !groups[1].tail) groups[0].coefficient = 1;
    for (const Group& group : groups) count_ += group.coefficient > 0;
  }
}

template <int D>
void RollingInteriorPoint<D>::solve(const InteriorPointRules& rules, const Vector& guess,
                                    FunctionRef<bool(double error, const Vector& r)> report) {
  start(rules, guess);
  follow_path(*this, rules, [&](int) -> std::optional<double> {
    physical_ = units_.reactions(r_);
    velocity_ = units_.velocities(u_);
    const double error = relative_error<Cone>(problem_, velocity_, physical_);
    if (report(error, physical_)) return std::nullopt;
    return error;
  });
}

template <int D>
void RollingInteriorPoint<D>::predict() {
  each_group([](Contact&, Group& group, int) { group.g = -group.lambda; });
}

template <int D>
void RollingInteriorPoint<D>::keep_predictor() {
  each_group([](Contact&, Group& group, int) {
    group.affine_x = group.dx;
    group.affine_y = group.dy;
  });
}

template <int D>
double RollingInteriorPoint<D>::gap(double step) const {
  double sum = 0;
  for (const Contact& contact : contacts_) {
    for (const Group& group : contact.groups) {
      if (!(group.coefficient > 0)) continue;
      sum += (group.x + step * group.dx).dot(group.y + step * group.dy);
    }
  }
  return sum / count_;
}

template <int D>
void RollingInteriorPoint<D>::advance(double step) {
  r_ += step * dr_;
  for (Index a = 0; a < problem_.nc(); ++a) {  // x follows from r, to the last digit
    const Vec r = r_.template segment<D>(D * a);
    auto& groups = contacts_[static_cast<std::size_t>(a)].groups;
    for (int g = 0; g < 2; ++g) {
      groups[g].x = lift(groups[g], g, r);
      groups[g].y += step * groups[g].dy;
    }
  }
}

/// E r of a group.
template <int D>
auto RollingInteriorPoint<D>::lift(const Group& group, int k, const Vec& r) -> Part {
  Part x = Part::Zero();
  x[0] = group.coefficient * r[0];
  if (group.tail) x.template tail<T>() = r.template segment<T>(1 + T * k);
  return x;
}

template <int D>
void RollingInteriorPoint<D>::start(const InteriorPointRules& rules, const Vector& guess) {
  const auto m = problem_.m();
  for (Vector* v : {&u_, &dr_, &rhs_, &residual_vector_}) v->setZero(m);
  r_ = units_.to_own(guess);
  units_.product(r_, units_.q(), u_);
  // x of x - y = z and x y = tau, without cancellation
  const auto root = [&](double z) {
    const double length = std::sqrt(z * z + 4 * rules.tau);
    return z > 0 ? 0.5 * (z + length) : 2 * rules.tau / (length - z);
  };
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Vec u = Cone(units_.friction(), a).modified(u_.template segment<D>(D * a));
    auto r = r_.template segment<D>(D * a);
    auto& groups = contacts_[static_cast<std::size_t>(a)].groups;
    const double squares = std::pow(groups[0].coefficient, 2) + std::pow(groups[1].coefficient, 2);
    double normal = 0;
    Vec inside = Vec::Zero();
    for (int g = 0; g < 2; ++g) {
      Group& group = groups[g];
      for (Part* part : {&group.x, &group.y, &group.dx, &group.dy}) part->setZero();
      if (!(group.coefficient > 0)) continue;
      Part z = lift(group, g, r);
      z[0] -= u[0] * group.coefficient / squares;
      if (group.tail) z.template tail<T>() -= u.template segment<T>(1 + T * g);
      const double norm = z.template tail<T>().norm();
      const double high = root(z[0] + norm);  // the spectral values of x
      const double low = root(z[0] - norm);
      normal = std::max(normal, 0.5 * (high + low) / group.coefficient);
      group.y[0] = 0.5 * rules.tau * (1 / high + 1 / low);
      if (!(norm > 0)) {
        group.y[0] = rules.tau / high;
        continue;
      }
      const ContactVector<T> along = z.template tail<T>() / norm;
      inside.template segment<T>(1 + T * g) = 0.5 * (high - low) * along;
      group.y.template tail<T>() = 0.5 * rules.tau * (1 / high - 1 / low) * along;
    }
    inside[0] = normal;  // the larger normal is within both cones
    r = inside;
    for (int g = 0; g < 2; ++g) groups[g].x = lift(groups[g], g, inside);
  }
}

template <int D>
void RollingInteriorPoint<D>::evaluate(const InteriorPointRules& /*rules*/) {
  units_.product(r_, units_.q(), u_, system_.workers());
  residual_ = 0;
  double gap = 0;
  for (Index a = 0; a < problem_.nc(); ++a) {
    const auto& groups = contacts_[static_cast<std::size_t>(a)].groups;
    Vec residual = u_.template segment<D>(D * a);
    for (int g = 0; g < 2; ++g) {
      const Group& group = groups[g];
      residual[0] -= group.coefficient * group.y[0];
      auto tail = residual.template segment<T>(1 + T * g);
      if (group.tail) {
        residual[0] += group.coefficient * group.y.template tail<T>().norm();
        tail -= group.y.template tail<T>();
      } else {
        tail.setZero();  // nothing holds this part
      }
      gap += group.x.dot(group.y);
    }
    residual_ = std::max(residual_, residual.template lpNorm<Eigen::Infinity>());
    residual_vector_.template segment<D>(D * a) = residual;
  }
  tau_ = gap / count_;
}

template <int D>
bool RollingInteriorPoint<D>::assemble(double delta, const InteriorPointRules& /*rules*/) {
  std::vector<double>& blocks = system_.blocks();
  for (Index a = 0; a < problem_.nc(); ++a) {
    Contact& contact = contacts_[static_cast<std::size_t>(a)];
    contact.P.setIdentity();
    // A is two blocks bordered by the normal part. Its complement is the sum of c^2 / (beta^2 k), k
    // = 1 + 2 ||w_T||^2, so its inverse has no cancellation
    contact.A.setZero();
    Vec border = Vec::Zero();
    border[0] = 1;
    double complement = 0;
    for (int g = 0; g < 2; ++g) {
      Group& group = contact.groups[g];
      const int at = 1 + T * g;
      const double c = group.coefficient;
      if (!(c > 0)) continue;
      Scaling& scaling = group.scaling;
      scaling.set(group.x, group.y);
      group.lambda = scaling.N * group.y;
      const ContactVector<T> w = scaling.w.template tail<T>();
      const double k = 1 + 2 * w.squaredNorm();
      complement += c * c / (scaling.beta * scaling.beta * k);
      if (!group.tail) continue;
      border.template segment<T>(at) = (2 * c * scaling.w[0] / k) * w;
      contact.A.template block<T, T>(at, at).setIdentity();
      contact.A.template block<T, T>(at, at) -= (2 / k) * w * w.transpose();
      contact.A.template block<T, T>(at, at) *= scaling.beta * scaling.beta;
      const double norm = group.y.template tail<T>().norm();
      if (norm > 0) {
        contact.P.template block<1, T>(0, at) = c * group.y.template tail<T>().transpose() / norm;
      }
    }
    contact.A += border * border.transpose() / complement;
    contact.D0 = contact.A * contact.P;
    const Mat regular = Mat::Identity() + delta * contact.D0;
    contact.regular = inverse<D>(regular);
    Eigen::Map<Mat>(blocks.data() + std::ptrdiff_t{D * D} * a) =
        units_.template block<D>(a, contact.regular * contact.D0);
  }
  return system_.factorise();
}

template <int D>
void RollingInteriorPoint<D>::correct(double sigma, bool second_order) {
  each_group([&](Contact&, Group& group, int) {
    Part target = Part::Zero();
    target[0] = sigma * tau_;
    if (second_order) {
      lorentz::subtract_product<S>(group.scaling.inverse * group.affine_x,
                                   group.scaling.N * group.affine_y, target);
    }
    group.g = lorentz::divide<S>(target, group.lambda) - group.lambda;
  });
}

template <int D>
void RollingInteriorPoint<D>::correct_shift(double step) {
  for (Index a = 0; a < problem_.nc(); ++a) {
    for (const Group& group : contacts_[static_cast<std::size_t>(a)].groups) {
      const ContactVector<T> y = group.y.template tail<T>();
      const double norm = y.norm();
      if (!group.tail || !(norm > 0)) continue;
      const ContactVector<T> dy = step * group.affine_y.template tail<T>();
      residual_vector_[D * a] += group.coefficient * ((y + dy).norm() - norm - y.dot(dy) / norm);
    }
  }
}

template <int D>
bool RollingInteriorPoint<D>::direction(double delta) {
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Contact& contact = contacts_[static_cast<std::size_t>(a)];
    Vec target = Vec::Zero();
    for (int g = 0; g < 2; ++g) {
      const Group& group = contact.groups[g];
      if (!(group.coefficient > 0)) continue;
      const Part part = group.scaling.inverse * group.g;
      target[0] += group.coefficient * part[0];
      if (group.tail) target.template segment<T>(1 + T * g) = part.template tail<T>();
    }
    dr_.template segment<D>(D * a) =
        contact.regular *
        (contact.A * target - contact.D0 * residual_vector_.template segment<D>(D * a));
  }
  dr_ = units_.divided(dr_);
  system_.solve(dr_);
  dr_ = units_.multiplied(dr_);
  if (!dr_.allFinite()) return false;
  units_.product(dr_, residual_vector_, rhs_, system_.workers());  // W dr + R
  rhs_ += delta * dr_;
  for (Index a = 0; a < problem_.nc(); ++a) {
    Contact& contact = contacts_[static_cast<std::size_t>(a)];
    const Vec dr = dr_.template segment<D>(D * a);
    const Vec du = contact.P * rhs_.template segment<D>(D * a);
    double left = du[0];
    double squares = 0;
    for (int g = 0; g < 2; ++g) {
      Group& group = contact.groups[g];
      if (!(group.coefficient > 0)) continue;
      group.dx = lift(group, g, dr);
      if (group.tail) group.dy.template tail<T>() = du.template segment<T>(1 + T * g);
      // the normal part comes from the scaled equation, which loses fewer digits than N^-2 dx
      group.dy[0] = ((group.g - group.scaling.inverse * group.dx)[0] -
                     group.scaling.N.template block<1, T>(0, 1).dot(group.dy.template tail<T>())) /
                    group.scaling.N(0, 0);
      left -= group.coefficient * group.dy[0];
      squares += group.coefficient * group.coefficient;
    }
    for (Group& group : contact.groups) group.dy[0] += group.coefficient * left / squares;
  }
  return true;
}

template <int D>
double RollingInteriorPoint<D>::longest() const {
  double step = std::numeric_limits<double>::infinity();
  for (const Contact& contact : contacts_) {
    for (const Group& group : contact.groups) {
      if (!(group.coefficient > 0)) continue;
      step = std::min(
          {step, lorentz::longest<S>(group.x, group.dx), lorentz::longest<S>(group.y, group.dy)});
    }
  }
  return step;
}

template class RollingInteriorPoint<3>;
template class RollingInteriorPoint<5>;

}  // namespace fclib
