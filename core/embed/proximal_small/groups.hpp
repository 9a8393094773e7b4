// Groups of lanes: who works on a problem.
#pragma once

#include "embed/proximal_small/numbers.hpp"

namespace fclib::proximal_small {

/// One lane: a thread of the host, or of the device.
struct Serial {
  static constexpr int size = 1;
  FCLIB_LANES int lane() const { return 0; }
  FCLIB_LANES void sync() const {}
  /// The sum of each x over the lanes, for all of them.
  template <int N>
  FCLIB_LANES void sum(double (&)[N]) const {}
  /// Whether x holds in any of the groups that run in step.
  FCLIB_LANES bool anyone(bool x) const { return x; }
  /// The largest n of the groups that run in step.
  FCLIB_LANES int most(int n) const { return n; }
};

#ifdef __CUDACC__
/// G lanes of a warp, whose groups run in step.
template <int G>
struct Lanes {
  static constexpr int size = G;
  static constexpr unsigned all = 0xffffffffu;
  __device__ __forceinline__ int lane() const { return threadIdx.x & (G - 1); }
  __device__ __forceinline__ void sync() const { __syncwarp(); }
  template <int N>
  __device__ __forceinline__ void sum(double (&x)[N]) const {
    FCLIB_UNROLL
    for (int far = G / 2; far > 0; far /= 2) {
      FCLIB_UNROLL
      for (int k = 0; k < N; ++k) x[k] += __shfl_xor_sync(all, x[k], far);
    }
  }
  __device__ __forceinline__ bool anyone(bool x) const { return __any_sync(all, x); }
  __device__ __forceinline__ int most(int n) const {
    return G == 32 ? n : __reduce_max_sync(all, n);
  }
};

/// A block of G threads.
template <int G>
struct Block {
  static constexpr int size = G;
  double* scratch;  // 4 for each warp, shared
  __device__ __forceinline__ int lane() const { return threadIdx.x; }
  __device__ __forceinline__ void sync() const { __syncthreads(); }
  template <int N>
  __device__ __forceinline__ void sum(double (&x)[N]) const {
    static_assert(N <= 4, "scratch is too short");
    FCLIB_UNROLL
    for (int far = 16; far > 0; far /= 2) {
      FCLIB_UNROLL
      for (int k = 0; k < N; ++k) x[k] += __shfl_xor_sync(0xffffffffu, x[k], far);
    }
    const int warp = threadIdx.x / 32;
    __syncthreads();
    if (threadIdx.x % 32 == 0) {
      for (int k = 0; k < N; ++k) scratch[4 * warp + k] = x[k];
    }
    __syncthreads();
    FCLIB_UNROLL
    for (int k = 0; k < N; ++k) {
      double total = 0;
      for (int w = 0; w < G / 32; ++w) total += scratch[4 * w + k];
      x[k] = total;
    }
  }
  __device__ __forceinline__ bool anyone(bool x) const { return x; }
  __device__ __forceinline__ int most(int n) const { return n; }
};
#endif

}  // namespace fclib::proximal_small
