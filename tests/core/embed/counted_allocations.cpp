#include "counted_allocations.hpp"

#include <cstddef>

// glibc lets a program stand in for its malloc; sanitizers have one of their own
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__GLIBC__)
#define FCLIB_NO_COUNT
#endif
#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define FCLIB_NO_COUNT
#endif
#endif

namespace fclib::testing {

#ifdef FCLIB_NO_COUNT

long allocations() { return -1; }

#else

namespace {
std::atomic<long> count{0};
}
long allocations() { return count.load(); }

// seen by the shared libraries too, the standard library of C++ above all
#pragma GCC visibility push(default)
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t size) {
  ++count;
  return __libc_malloc(size);
}
void* calloc(std::size_t number, std::size_t size) {
  ++count;
  return __libc_calloc(number, size);
}
void* realloc(void* old, std::size_t size) {
  ++count;
  return __libc_realloc(old, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++count;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** result, std::size_t alignment, std::size_t size) {
  ++count;
  *result = __libc_memalign(alignment, size);
  return *result == nullptr ? 12 : 0;
}
}
#pragma GCC visibility pop

#endif

}  // namespace fclib::testing
