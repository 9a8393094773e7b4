#include "embed/alone.hpp"

#include <Eigen/Core>

namespace fclib {

namespace {

using Wide = Eigen::Array<double, 4, 1>;

template <class>
constexpr int lanes_of = 4;

template <class>
EIGEN_ALWAYS_INLINE Wide gather(const double* const* at, int i) {
  return {at[0][i], at[1][i], at[2][i], at[3][i]};
}

EIGEN_ALWAYS_INLINE void gather_two(const double* const* at, int i, Wide& first, Wide& second) {
  for (int k = 0; k < 4; ++k) {
    first[k] = at[k][i];
    second[k] = at[k][i + 1];
  }
}

template <int D>
EIGEN_ALWAYS_INLINE void scatter(const Wide* x, double* to) {
  for (int k = 0; k < 4; ++k) {
    for (int i = 0; i < D; ++i) to[D * k + i] = x[i][k];
  }
}

EIGEN_ALWAYS_INLINE unsigned at_most(const Wide& a, const Wide& b) {
  unsigned bits = 0;
  for (int k = 0; k < 4; ++k) bits |= static_cast<unsigned>(a[k] <= b[k]) << k;
  return bits;
}

}  // namespace

}  // namespace fclib

#include "embed/alone_steps.hpp"

namespace fclib {

template <int D>
void solve_alone_anywhere(double tolerance, int count, const LocalArrays& first, Alone& found) {
  solve_all_alone<D, Wide>(tolerance, count, first, found);
}

template <int D>
void solve_alone(double tolerance, int count, const LocalArrays& first, Alone& found) {
#ifdef FCLIB_AVX2
  if (has_avx2()) {
    solve_alone_avx2(std::integral_constant<int, D>(), tolerance, count, first, found);
    return;
  }
#endif
  solve_alone_anywhere<D>(tolerance, count, first, found);
}

template void solve_alone<2>(double, int, const LocalArrays&, Alone&);
template void solve_alone<3>(double, int, const LocalArrays&, Alone&);
template void solve_alone_anywhere<2>(double, int, const LocalArrays&, Alone&);
template void solve_alone_anywhere<3>(double, int, const LocalArrays&, Alone&);

}  // namespace fclib
