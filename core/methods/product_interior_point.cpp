#include "methods/product_interior_point.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "contact/inverse.hpp"
#include "methods/interior_path.hpp"
#include "reduced/relative_error.hpp"

namespace fclib {

template <class Cone>
ProductInteriorPoint<Cone>::ProductInteriorPoint(const ReducedProblem& problem,
                                                 CoupledSystem& system)
    : problem_(problem), system_(system), units_(problem) {
  contacts_.resize(static_cast<std::size_t>(problem.nc()));
  for (Index a = 0; a < problem.nc(); ++a) {
    Contact& contact = contacts_[static_cast<std::size_t>(a)];
    const Cone cone(units_.friction(), a);
    bool any = false;
    for_each_group<Cone>([&](auto g) {
      auto& group = std::get<g>(contact.groups);
      group.coefficient = cone.coefficient(g);
      group.tail = group.coefficient > 0;
      any = any || group.tail;
    });
    if (!any) std::get<0>(contact.groups).coefficient = 1;
    contact.each([&](auto&, auto) { ++count_; });
  }
}

template <class Cone>
void ProductInteriorPoint<Cone>::solve(const InteriorPointRules& rules, const Vector& guess,
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

template <class Cone>
void ProductInteriorPoint<Cone>::predict() {
  for (Contact& contact : contacts_) {
    contact.each([](auto& group, auto) { group.g = -group.lambda; });
  }
}

template <class Cone>
void ProductInteriorPoint<Cone>::keep_predictor() {
  for (Contact& contact : contacts_) {
    contact.each([](auto& group, auto) {
      group.affine_x = group.dx;
      group.affine_y = group.dy;
    });
  }
}

template <class Cone>
double ProductInteriorPoint<Cone>::gap(double step) const {
  double sum = 0;
  for (const Contact& contact : contacts_) {
    contact.each([&](const auto& group, auto) {
      sum += (group.x + step * group.dx).dot(group.y + step * group.dy);
    });
  }
  return sum / count_;
}

template <class Cone>
void ProductInteriorPoint<Cone>::advance(double step) {
  r_ += step * dr_;
  for (Index a = 0; a < problem_.nc(); ++a) {  // x follows from r, to the last digit
    const Vec r = r_.template segment<D>(D * a);
    contacts_[static_cast<std::size_t>(a)].each([&](auto& group, auto at) {
      group.x = group.lift(at, r);
      group.y += step * group.dy;
    });
  }
}

template <class Cone>
void ProductInteriorPoint<Cone>::start(const InteriorPointRules& rules, const Vector& guess) {
  const auto m = problem_.m();
  for (Vector* v : {&u_, &dr_, &rhs_, &residual_vector_}) v->setZero(m);
  r_ = units_.to_own(guess);
  units_.product(r_, units_.q(), u_);
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Vec u = Cone(units_.friction(), a).modified(u_.template segment<D>(D * a));
    auto r = r_.template segment<D>(D * a);
    Contact& contact = contacts_[static_cast<std::size_t>(a)];
    double squares = 0;
    contact.each([&](auto& group, auto) { squares += std::pow(group.coefficient, 2); });
    double normal = 0;
    Vec inside = Vec::Zero();
    contact.each([&]<class Group>(Group& group, auto at) {
      constexpr int T = Group::T;
      using Part = typename Group::Part;
      for (Part* part : {&group.x, &group.y, &group.dx, &group.dy}) part->setZero();
      Part z = group.lift(at, r);
      z[0] -= u[0] * group.coefficient / squares;
      if (group.tail) z.template tail<T>() -= u.template segment<T>(at);
      const double norm = z.template tail<T>().norm();
      const double high = interior::root(z[0] + norm, rules.tau);  // the spectral values of x
      const double low = interior::root(z[0] - norm, rules.tau);
      normal = std::max(normal, 0.5 * (high + low) / group.coefficient);
      group.y[0] = 0.5 * rules.tau * (1 / high + 1 / low);
      if (!(norm > 0)) {
        group.y[0] = rules.tau / high;
        return;
      }
      const ContactVector<T> along = z.template tail<T>() / norm;
      inside.template segment<T>(at) = 0.5 * (high - low) * along;
      group.y.template tail<T>() = 0.5 * rules.tau * (1 / high - 1 / low) * along;
    });
    inside[0] = normal;  // the largest normal is within all cones
    r = inside;
    contact.each([&](auto& group, auto at) { group.x = group.lift(at, inside); });
  }
}

template <class Cone>
void ProductInteriorPoint<Cone>::evaluate(const InteriorPointRules& /*rules*/) {
  units_.product(r_, units_.q(), u_, system_.workers());
  residual_ = 0;
  double gap = 0;
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Vec u = u_.template segment<D>(D * a);
    Vec residual = Vec::Zero();  // without a cone, nothing holds a part
    residual[0] = u[0];
    contacts_[static_cast<std::size_t>(a)].each([&]<class Group>(const Group& group, auto at) {
      constexpr int T = Group::T;
      residual[0] -= group.coefficient * group.y[0];
      if (group.tail) {
        residual[0] += group.coefficient * group.y.template tail<T>().norm();
        residual.template segment<T>(at) = u.template segment<T>(at) - group.y.template tail<T>();
      }
      gap += group.x.dot(group.y);
    });
    residual_ = std::max(residual_, residual.template lpNorm<Eigen::Infinity>());
    residual_vector_.template segment<D>(D * a) = residual;
  }
  tau_ = gap / count_;
}

template <class Cone>
bool ProductInteriorPoint<Cone>::assemble(double delta, const InteriorPointRules& /*rules*/) {
  std::vector<double>& blocks = system_.blocks();
  for (Index a = 0; a < problem_.nc(); ++a) {
    Contact& contact = contacts_[static_cast<std::size_t>(a)];
    contact.P.setIdentity();
    // A is one block for each group, bordered by the normal part. Its complement is the sum of c^2
    // / (beta^2 k), k = 1 + 2 ||w_T||^2, so its inverse has no cancellation
    contact.A.setZero();
    Vec border = Vec::Zero();
    border[0] = 1;
    double complement = 0;
    contact.each([&]<class Group>(Group& group, auto start) {
      constexpr int T = Group::T;
      constexpr int at = start;
      const double c = group.coefficient;
      auto& scaling = group.scaling;
      scaling.set(group.x, group.y);
      group.lambda = scaling.N * group.y;
      const ContactVector<T> w = scaling.w.template tail<T>();
      const double k = 1 + 2 * w.squaredNorm();
      complement += c * c / (scaling.beta * scaling.beta * k);
      if (!group.tail) return;
      border.template segment<T>(at) = (2 * c * scaling.w[0] / k) * w;
      contact.A.template block<T, T>(at, at).setIdentity();
      contact.A.template block<T, T>(at, at) -= (2 / k) * w * w.transpose();
      contact.A.template block<T, T>(at, at) *= scaling.beta * scaling.beta;
      const double norm = group.y.template tail<T>().norm();
      if (norm > 0) {
        contact.P.template block<1, T>(0, at) = c * group.y.template tail<T>().transpose() / norm;
      }
    });
    contact.A += border * border.transpose() / complement;
    contact.D0 = contact.A * contact.P;
    const Mat regular = Mat::Identity() + delta * contact.D0;
    contact.regular = inverse<D>(regular);
    Eigen::Map<Mat>(blocks.data() + std::ptrdiff_t{D * D} * a) =
        units_.template block<D>(a, contact.regular * contact.D0);
  }
  return system_.factorise();
}

template <class Cone>
void ProductInteriorPoint<Cone>::correct(double sigma, bool second_order) {
  for (Contact& contact : contacts_) {
    contact.each([&]<class Group>(Group& group, auto) {
      constexpr int S = Group::S;
      typename Group::Part target = Group::Part::Zero();
      target[0] = sigma * tau_;
      if (second_order) {
        lorentz::subtract_product<S>(group.scaling.inverse * group.affine_x,
                                     group.scaling.N * group.affine_y, target);
      }
      group.g = lorentz::divide<S>(target, group.lambda) - group.lambda;
    });
  }
}

template <class Cone>
void ProductInteriorPoint<Cone>::correct_shift(double step) {
  for (Index a = 0; a < problem_.nc(); ++a) {
    contacts_[static_cast<std::size_t>(a)].each([&]<class Group>(const Group& group, auto) {
      constexpr int T = Group::T;
      const ContactVector<T> y = group.y.template tail<T>();
      const double norm = y.norm();
      if (!group.tail || !(norm > 0)) return;
      const ContactVector<T> dy = step * group.affine_y.template tail<T>();
      residual_vector_[D * a] += group.coefficient * ((y + dy).norm() - norm - y.dot(dy) / norm);
    });
  }
}

template <class Cone>
bool ProductInteriorPoint<Cone>::direction(double delta) {
  for (Index a = 0; a < problem_.nc(); ++a) {
    const Contact& contact = contacts_[static_cast<std::size_t>(a)];
    Vec target = Vec::Zero();
    contact.each([&]<class Group>(const Group& group, auto at) {
      constexpr int T = Group::T;
      const typename Group::Part part = group.scaling.inverse * group.g;
      target[0] += group.coefficient * part[0];
      if (group.tail) target.template segment<T>(at) = part.template tail<T>();
    });
    dr_.template segment<D>(D * a) =
        contact.regular *
        (contact.A * target - contact.D0 * residual_vector_.template segment<D>(D * a));
  }
  dr_ = units_.divided(dr_);
  system_.solve(dr_, tau_ < interior::refined_tau);
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
    contact.each([&]<class Group>(Group& group, auto at) {
      constexpr int T = Group::T;
      group.dx = group.lift(at, dr);
      if (group.tail) group.dy.template tail<T>() = du.template segment<T>(at);
      // the normal part comes from the scaled equation, which loses fewer digits than N^-2 dx
      group.dy[0] = ((group.g - group.scaling.inverse * group.dx)[0] -
                     group.scaling.N.template block<1, T>(0, 1).dot(group.dy.template tail<T>())) /
                    group.scaling.N(0, 0);
      left -= group.coefficient * group.dy[0];
      squares += group.coefficient * group.coefficient;
    });
    contact.each([&](auto& group, auto) { group.dy[0] += group.coefficient * left / squares; });
  }
  return true;
}

template <class Cone>
double ProductInteriorPoint<Cone>::longest() const {
  double step = std::numeric_limits<double>::infinity();
  for (const Contact& contact : contacts_) {
    contact.each([&]<class Group>(const Group& group, auto) {
      constexpr int S = Group::S;
      step = std::min(
          {step, lorentz::longest<S>(group.x, group.dx), lorentz::longest<S>(group.y, group.dy)});
    });
  }
  return step;
}

#define FCLIB_INSTANTIATE(Cone) template class ProductInteriorPoint<Cone>;
FCLIB_FOR_EACH_PRODUCT(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
