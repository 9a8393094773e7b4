// Small problems in the caller's arrays.
#pragma once

namespace fclib {

/// A local problem in the caller's arrays, or the first one of several: W (m x m, by rows), q, mu,
/// the guess and u, which may be null, and r.
struct LocalArrays {
  const double* W;
  const double* q;
  const double* mu;
  const double* guess;
  double* r;
  double* u;
};

}  // namespace fclib
