// The coefficients of friction: what cones are made from.
#pragma once

#include <Eigen/Core>

namespace fclib {

/// The coefficients of all contacts.
struct Friction {
  Eigen::VectorXd mu;    ///< sliding (nc)
  Eigen::VectorXd mu_r;  ///< rolling (nc), empty if contacts do not resist rolling
};

}  // namespace fclib
