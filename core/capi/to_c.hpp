// What a caller gets: structs in memory from malloc, and how they are freed.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <new>
#include <string>

#include "capi/structs.hpp"
#include "io/hdf5/raw.hpp"

namespace fclib::c {

void free_members(fclib_matrix& a);

template <class C>
void free_members(C& c) {
  for_each_member<C>([&]<class Pointer>(const auto&, Pointer member) {
    using Type = std::remove_reference_t<decltype(c.*member)>;
    if constexpr (std::is_same_v<Type, fclib_matrix*>) {
      if (c.*member != nullptr) free_members(*(c.*member));
    }
    if constexpr (std::is_pointer_v<Type>) std::free(c.*member);
  });
  if constexpr (requires { c.info; }) {
    if (c.info != nullptr) free_members(*c.info);
    std::free(c.info);
  }
}

struct Free {
  template <class C>
  void operator()(C* c) const {
    free_members(*c);
    std::free(c);
  }
};

/// A C struct of zeros. It frees itself and its members unless it is released.
template <class C>
using Owned = std::unique_ptr<C, Free>;

template <class T>
T* allocate(std::size_t count) {
  auto* memory = static_cast<T*>(std::calloc(std::max<std::size_t>(count, 1), sizeof(T)));
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

/// The arrays of the problem become those of the C struct. Clients of 3.1 do not know dense
/// matrices: a dense matrix becomes one by columns unless the caller wants to keep it.
template <class C>
C* to_c(RawProblem& problem, bool keep_dense);

/// The same for a problem of the core. Dense matrices become matrices by columns.
template <class C>
C* to_c(const CoreOf<C>& problem);

/// Fills the members of a solution from a file. Their sizes are those of its problem.
void to_c(const Solution& solution, const Problem& outline, const std::string& where,
          fclib_solution& c);

}  // namespace fclib::c
