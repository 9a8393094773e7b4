// The merit of libfclib 3.1, MERIT_1, kept so that published figures can be compared.
//
//   local    ||F|| / (1 + sqrt(||q||)) + ||V^T r + R lambda + s|| / (1 + ||s||)
//   global   ||F|| / (1 + sqrt(||q||)) + ||G^T v + b|| / (1 + ||b||)
//            + ||M v - H r - G lambda - f|| / (1 + ||f||),   q = H^T M^-1 f + w
//
// with F^a = r^a - P_K(r^a - u^^a) for each contact a, all in double precision. The square root of
// a norm in the denominator comes from that library. The library itself computes it only for local
// problems with d = 3 and matrices by columns. To judge a solution, use merit().
#pragma once

#include "problem.hpp"

namespace fclib {

/// MERIT_1 of (solution, problem). It requires the same as merit().
template <class P>
double merit_1(const P& problem, const Solution& solution);

#define FCLIB_DECLARE(P) extern template double merit_1<P>(const P&, const Solution&);
FCLIB_FOR_EACH_FORMULATION(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
