// The interior point of methods/interior_point.hpp for sliding and rolling friction. The cone {
// ||r_T|| <= mu r_N, ||r_R|| <= mu_r r_N } is two Lorentz cones that share r_N. Its dual is the sum
// of their duals:
//
//   x1 = (mu r_N, r_T),  x2 = (mu_r r_N, r_R);  y1 = (a, u_T),  y2 = (b, u_R)
//   x1 o y1 = tau e,  x2 o y2 = tau e,  u^ = (mu a + mu_r b, u_T, u_R)
//   R = u + (mu ||u_T|| + mu_r ||u_R||) e_N - u^ = 0,  u = W r + q
//
// With x_i = E_i r and scalings N_i, the split of u^_N into a and b leaves Newton's system contact
// by contact. With A = sum E_i^T N_i^-2 E_i and D0 = A^-1 P it is the system of the Coulomb cone. A
// coefficient that is zero has no cone. If both are zero, x1 = r_N.
#pragma once

#include <array>
#include <vector>

#include "contact/lorentz.hpp"
#include "contact/rolling.hpp"
#include "function_ref.hpp"
#include "methods/interior_rules.hpp"
#include "reduced/own_units.hpp"
#include "systems/coupled_system.hpp"

namespace fclib {

template <int D>
class RollingInteriorPoint {
 public:
  using Cone = Rolling<D>;

  RollingInteriorPoint(const ReducedProblem& problem, CoupledSystem& system);

  /// Like InteriorPoint::solve, without `associated` and `smoothing`.
  void solve(const InteriorPointRules& rules, const Vector& guess,
             FunctionRef<bool(double error, const Vector& r)> report);

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
  static constexpr int T = Cone::group_size;
  static constexpr int S = 1 + T;
  using Vec = ContactVector<D>;
  using Mat = ContactMatrix<D>;
  using Part = lorentz::Point<S>;
  using Scaling = lorentz::Scaling<S>;

  struct Group {  // of a contact
    double coefficient = 0;
    bool tail = false;  // whether it has tangential components; else a half-line, or nothing
    Part x, y, dx, dy, affine_x, affine_y, g, lambda;
    Scaling scaling;
  };
  struct Contact {
    std::array<Group, 2> groups;
    Mat P, A, D0, regular;  // A: the inverse of the one above
  };

  [[nodiscard]] static Part lift(const Group& group, int k, const Vec& r);
  void start(const InteriorPointRules& rules, const Vector& guess);

  template <class F>
  void each_group(const F& f) {
    for (Contact& contact : contacts_) {
      for (int k = 0; k < 2; ++k) {
        if (contact.groups[k].coefficient > 0) f(contact, contact.groups[k], k);
      }
    }
  }

  const ReducedProblem& problem_;
  CoupledSystem& system_;
  OwnUnits units_;
  double tau_ = 1;
  double residual_ = 0;
  double count_ = 0;  // cones
  std::vector<Contact> contacts_;
  Vector r_, u_, dr_, rhs_, residual_vector_, physical_, velocity_;
};

extern template class RollingInteriorPoint<3>;
extern template class RollingInteriorPoint<5>;

}  // namespace fclib
