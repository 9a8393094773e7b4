// The coefficients of friction: what cones are made from.
#pragma once

#include <Eigen/Core>

namespace fclib {

/// The coefficients of all contacts.
struct Friction {
  Eigen::VectorXd mu;    ///< sliding (nc)
  Eigen::VectorXd mu_r;  ///< rolling (nc), empty if contacts do not resist rolling
  Eigen::VectorXd mu_s;  ///< spin (nc), empty if contacts do not resist it
  bool coupled = false;  ///< whether sliding and spin share one limit, an ellipsoid

  /// The first components of a contact of d components that are lengths: N and T. The others are
  /// angles.
  [[nodiscard]] int lengths(int d) const {
    if (mu_s.size() > 0) return 3;
    return mu_r.size() > 0 ? (d + 1) / 2 : d;
  }

  /// Calls visit(coefficients) for the vectors that there are.
  template <class Visit>
  void for_each(const Visit& visit) {
    for (Eigen::VectorXd* const values : {&mu, &mu_r, &mu_s}) {
      if (values->size() > 0) visit(*values);
    }
  }

  /// Those of some contacts.
  template <class Contacts>
  [[nodiscard]] Friction of(const Contacts& contacts) const {
    Friction part = *this;
    part.for_each(
        [&](Eigen::VectorXd& values) { values = Eigen::VectorXd(values)(contacts).eval(); });
    return part;
  }
};

}  // namespace fclib
