// Eigen includes this header of x86 and takes nothing of it. Emscripten has those it takes from,
// which make SSE2 of the SIMD of WebAssembly, and not this one.
#pragma once

// For a GNU compiler older than 6.3, which Clang says it is, Eigen writes assembly of x86.
#if defined(EIGEN_COMP_GNUC) && EIGEN_COMP_GNUC < 63
#undef EIGEN_COMP_GNUC
#define EIGEN_COMP_GNUC 63
#endif
