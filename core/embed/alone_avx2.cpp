// Contacts without others on processors with AVX2. Only the functions of this file use it, and all
// that they call is compiled into them: a function that others share must run on any processor.
#include "embed/alone.hpp"

#ifdef FCLIB_AVX2

#include <immintrin.h>

#define FCLIB_AVX2_CODE __attribute__((target("avx2")))
#define FCLIB_IN_LANES inline __attribute__((always_inline, target("avx2")))

namespace fclib {

namespace {

/// Four numbers, with the functions and the digits of an array of Eigen. If one of two numbers is
/// NaN, the greater and the less of them are the first, as there.
struct Four {
  __m256d x;

  FCLIB_IN_LANES Four() {}
  // by hand: a copy by halves would have to wait for both of them
  FCLIB_IN_LANES Four(const Four& other) : x(other.x) {}
  FCLIB_IN_LANES Four& operator=(const Four& other) {
    x = other.x;
    return *this;
  }
  FCLIB_IN_LANES Four(const __m256d& all) : x(all) {}
  FCLIB_IN_LANES Four(double all) : x(_mm256_set1_pd(all)) {}
  FCLIB_IN_LANES static Four Zero() { return _mm256_setzero_pd(); }
  FCLIB_IN_LANES static Four Constant(double all) { return all; }

  FCLIB_IN_LANES Four max(const Four& other) const { return _mm256_max_pd(other.x, x); }
  FCLIB_IN_LANES Four min(const Four& other) const { return _mm256_min_pd(other.x, x); }
  FCLIB_IN_LANES Four abs() const { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), x); }
  FCLIB_IN_LANES Four sqrt() const { return _mm256_sqrt_pd(x); }
  FCLIB_IN_LANES Four inverse() const { return _mm256_div_pd(_mm256_set1_pd(1), x); }

  FCLIB_IN_LANES friend Four operator+(const Four& a, const Four& b) {
    return _mm256_add_pd(a.x, b.x);
  }
  FCLIB_IN_LANES friend Four operator-(const Four& a, const Four& b) {
    return _mm256_sub_pd(a.x, b.x);
  }
  FCLIB_IN_LANES friend Four operator*(const Four& a, const Four& b) {
    return _mm256_mul_pd(a.x, b.x);
  }
  FCLIB_IN_LANES friend Four operator/(const Four& a, const Four& b) {
    return _mm256_div_pd(a.x, b.x);
  }
  FCLIB_IN_LANES void operator+=(const Four& b) { x = _mm256_add_pd(x, b.x); }
  FCLIB_IN_LANES void operator-=(const Four& b) { x = _mm256_sub_pd(x, b.x); }
  FCLIB_IN_LANES void operator*=(const Four& b) { x = _mm256_mul_pd(x, b.x); }
};

/// Eight of them: what one half waits for, the other half computes.
struct Eight {
  Four low, high;

  FCLIB_IN_LANES Eight() {}
  FCLIB_IN_LANES Eight(const Eight& other) : low(other.low), high(other.high) {}
  FCLIB_IN_LANES Eight& operator=(const Eight& other) {
    low = other.low;
    high = other.high;
    return *this;
  }
  FCLIB_IN_LANES Eight(const Four& a, const Four& b) : low(a), high(b) {}
  FCLIB_IN_LANES Eight(double all) : low(all), high(all) {}
  FCLIB_IN_LANES static Eight Zero() { return {Four::Zero(), Four::Zero()}; }
  FCLIB_IN_LANES static Eight Constant(double all) { return all; }

  FCLIB_IN_LANES Eight max(const Eight& other) const {
    return {low.max(other.low), high.max(other.high)};
  }
  FCLIB_IN_LANES Eight min(const Eight& other) const {
    return {low.min(other.low), high.min(other.high)};
  }
  FCLIB_IN_LANES Eight abs() const { return {low.abs(), high.abs()}; }
  FCLIB_IN_LANES Eight sqrt() const { return {low.sqrt(), high.sqrt()}; }
  FCLIB_IN_LANES Eight inverse() const { return {low.inverse(), high.inverse()}; }

  FCLIB_IN_LANES friend Eight operator+(const Eight& a, const Eight& b) {
    return {a.low + b.low, a.high + b.high};
  }
  FCLIB_IN_LANES friend Eight operator-(const Eight& a, const Eight& b) {
    return {a.low - b.low, a.high - b.high};
  }
  FCLIB_IN_LANES friend Eight operator*(const Eight& a, const Eight& b) {
    return {a.low * b.low, a.high * b.high};
  }
  FCLIB_IN_LANES friend Eight operator/(const Eight& a, const Eight& b) {
    return {a.low / b.low, a.high / b.high};
  }
  FCLIB_IN_LANES void operator+=(const Eight& b) { *this = *this + b; }
  FCLIB_IN_LANES void operator-=(const Eight& b) { *this = *this - b; }
  FCLIB_IN_LANES void operator*=(const Eight& b) { *this = *this * b; }
};

template <class Wide>
constexpr int lanes_of = sizeof(Wide) / sizeof(double);

template <class Wide>
FCLIB_IN_LANES Wide gather(const double* const* at, int i) {
  if constexpr (lanes_of<Wide> == 8) {
    return {gather<Four>(at, i), gather<Four>(at + 4, i)};
  } else {
    return _mm256_setr_pd(at[0][i], at[1][i], at[2][i], at[3][i]);
  }
}

/// The halves of two lanes' pairs, one behind the other.
FCLIB_IN_LANES __m256d two_pairs(const double* low, const double* high) {
  return _mm256_insertf128_pd(_mm256_castpd128_pd256(_mm_loadu_pd(low)), _mm_loadu_pd(high), 1);
}

FCLIB_IN_LANES void gather_two(const double* const* at, int i, Four& first, Four& second) {
  const __m256d even = two_pairs(at[0] + i, at[2] + i);
  const __m256d odd = two_pairs(at[1] + i, at[3] + i);
  first = _mm256_unpacklo_pd(even, odd);
  second = _mm256_unpackhi_pd(even, odd);
}

FCLIB_IN_LANES void gather_two(const double* const* at, int i, Eight& first, Eight& second) {
  gather_two(at, i, first.low, second.low);
  gather_two(at + 4, i, first.high, second.high);
}

template <int D>
FCLIB_IN_LANES void scatter(const Four* x, double* to) {
  if constexpr (D == 1) {
    _mm256_storeu_pd(to, x[0].x);
    return;
  } else {
    const __m256d even = _mm256_unpacklo_pd(x[0].x, x[1].x);
    const __m256d odd = _mm256_unpackhi_pd(x[0].x, x[1].x);
    _mm_storeu_pd(to, _mm256_castpd256_pd128(even));
    _mm_storeu_pd(to + D, _mm256_castpd256_pd128(odd));
    _mm_storeu_pd(to + 2 * D, _mm256_extractf128_pd(even, 1));
    _mm_storeu_pd(to + 3 * D, _mm256_extractf128_pd(odd, 1));
    if constexpr (D == 3) {
      const __m128d low = _mm256_castpd256_pd128(x[2].x);
      const __m128d high = _mm256_extractf128_pd(x[2].x, 1);
      _mm_storel_pd(to + 2, low);
      _mm_storeh_pd(to + 5, low);
      _mm_storel_pd(to + 8, high);
      _mm_storeh_pd(to + 11, high);
    }
  }
}

template <int D>
FCLIB_IN_LANES void scatter(const Eight* x, double* to) {
  Four low[D];
  Four high[D];
  for (int i = 0; i < D; ++i) {
    low[i] = x[i].low;
    high[i] = x[i].high;
  }
  scatter<D>(low, to);
  scatter<D>(high, to + 4 * D);
}

FCLIB_IN_LANES unsigned at_most(const Four& a, const Four& b) {
  return static_cast<unsigned>(_mm256_movemask_pd(_mm256_cmp_pd(a.x, b.x, _CMP_LE_OQ)));
}

FCLIB_IN_LANES unsigned at_most(const Eight& a, const Eight& b) {
  return at_most(a.low, b.low) | at_most(a.high, b.high) << 4;
}

}  // namespace

}  // namespace fclib

#include "embed/alone_steps.hpp"

namespace fclib {

FCLIB_AVX2_CODE void solve_alone_avx2(std::integral_constant<int, 2>, double tolerance, int count,
                                      const LocalArrays& first, Alone& found) {
  solve_all_alone<2, Eight, Four>(tolerance, count, first, found);
}

FCLIB_AVX2_CODE void solve_alone_avx2(std::integral_constant<int, 3>, double tolerance, int count,
                                      const LocalArrays& first, Alone& found) {
  solve_all_alone<3, Eight, Four>(tolerance, count, first, found);
}

}  // namespace fclib

#endif
