// The interior point of methods/interior_point.hpp for the laws of more than one group: sliding
// with spin, rolling or both. The cone { ||r_g|| <= mu_g r_N for each group g } is Lorentz cones
// that share r_N. Its dual is the sum of their duals:
//
//   x_g = (mu_g r_N, r_g),  y_g = (a_g, u_g),  x_g o y_g = tau e
//   u^ = (sum mu_g a_g, u_1, u_2, ...)
//   R = u + (sum mu_g ||u_g||) e_N - u^ = 0,  u = W r + q
//
// With x_g = E_g r and scalings N_g, the split of u^_N into the a_g leaves Newton's system contact
// by contact. With A = sum E_g^T N_g^-2 E_g and D0 = A^-1 P it is the system of the Coulomb cone. A
// coefficient that is zero has no cone. If all are zero, x_1 = r_N.
#pragma once

#include <tuple>
#include <vector>

#include "contact/cones.hpp"
#include "contact/lorentz.hpp"
#include "function_ref.hpp"
#include "methods/interior_point.hpp"
#include "methods/interior_rules.hpp"
#include "reduced/own_units.hpp"
#include "systems/coupled_system.hpp"

namespace fclib {

template <class ConeType>
class ProductInteriorPoint {
 public:
  using Cone = ConeType;
  static constexpr int D = Cone::dim;

  ProductInteriorPoint(const ReducedProblem& problem, CoupledSystem& system);

  /// Like InteriorPoint::solve, without `associated` and `smoothing`.
  void solve(const InteriorPointRules& rules, const Vector& guess,
             FunctionRef<bool(double error, const Vector& r)> report);

  [[nodiscard]] int iterations() const { return iterations_; }

  // ---- what follow_path (methods/interior_path.hpp) calls

  [[nodiscard]] double tau() const { return tau_; }
  [[nodiscard]] double residual() const { return residual_; }
  void evaluate(const InteriorPointRules& rules);
  bool assemble(double delta, const InteriorPointRules& rules);
  void predict();
  void keep_predictor();
  void correct(double sigma, bool second_order);
  void correct_shift(double step);
  bool direction(double delta);
  [[nodiscard]] double longest() const;
  [[nodiscard]] double gap(double step) const;
  void advance(double step);

 private:
  using Vec = ContactVector<D>;
  using Mat = ContactMatrix<D>;

  template <int size>
  struct Group {  // of a contact
    static constexpr int T = size;
    static constexpr int S = 1 + size;
    using Part = lorentz::Point<S>;
    double coefficient = 0;
    bool tail = false;  // whether it has tangential components; else a half-line, or nothing
    Part x, y, dx, dy, affine_x, affine_y, g, lambda;
    lorentz::Scaling<S> scaling;

    /// E r of this group, which starts at a component.
    [[nodiscard]] Part lift(int at, const Vec& r) const {
      Part x = Part::Zero();
      x[0] = coefficient * r[0];
      if (tail) x.template tail<T>() = r.template segment<T>(at);
      return x;
    }
  };

  template <class Numbers>
  struct GroupsOf;
  template <int... g>
  struct GroupsOf<std::integer_sequence<int, g...>> {
    using type = std::tuple<Group<Cone::size(g)>...>;
  };

  struct Contact {
    typename GroupsOf<std::make_integer_sequence<int, Cone::groups>>::type groups;
    Mat P, A, D0, regular;  // A: the inverse of the one above

    /// Calls f(group, start) for the groups that have a cone.
    template <class F>
    void each(const F& f) {
      for_each_group<Cone>([&](auto g) {
        auto& group = std::get<g>(groups);
        if (group.coefficient > 0) f(group, std::integral_constant<int, Cone::start(g)>{});
      });
    }
    template <class F>
    void each(const F& f) const {
      for_each_group<Cone>([&](auto g) {
        const auto& group = std::get<g>(groups);
        if (group.coefficient > 0) f(group, std::integral_constant<int, Cone::start(g)>{});
      });
    }
  };

  void start(const InteriorPointRules& rules, const Vector& guess);

  const ReducedProblem& problem_;
  CoupledSystem& system_;
  OwnUnits units_;
  double tau_ = 1;
  double residual_ = 0;
  double count_ = 0;  // cones
  int iterations_ = 0;
  std::vector<Contact> contacts_;
  Vector r_, u_, dr_, rhs_, residual_vector_, physical_, velocity_;
};

/// The interior point of a cone.
template <class Cone>
struct InteriorPointFor {
  using type = ProductInteriorPoint<Cone>;
};
template <int D>
struct InteriorPointFor<Coulomb<D>> {
  using type = InteriorPoint<D>;
};

#define FCLIB_FOR_EACH_PRODUCT(X) X(Rolling<3>) X(Rolling<5>) X(Spin<4>) X(Spin<6>)
#define FCLIB_DECLARE(Cone) extern template class ProductInteriorPoint<Cone>;
FCLIB_FOR_EACH_PRODUCT(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
