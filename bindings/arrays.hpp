// Vectors and matrices between C++ and Python: NumPy arrays and SciPy sparse arrays.
//
// The arrays that Python gets are read-only views. They keep their owner alive, and no number is
// copied. What comes from Python is copied once, so that a problem owns its data.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "linalg/matrix.hpp"

namespace fclib::bindings {

namespace nb = nanobind;

/// A read-only view of `size` numbers that live as long as `owner`.
template <class Number>
nb::object view(const Number* data, std::size_t size, nb::handle owner) {
  static const Number nothing{};  // NumPy wants an address for an empty array too
  const std::size_t shape[1] = {size};
  return nb::cast(nb::ndarray<nb::numpy, const Number, nb::ndim<1>>(size > 0 ? data : &nothing, 1,
                                                                    shape, owner));
}

nb::object to_python(const Vector& vector, nb::handle owner);
/// csr_array, csc_array or coo_array; a dense matrix is a two-dimensional NumPy array. If the
/// indices of a compressed matrix are not sorted and unique, it is copied: SciPy sorts its arrays
/// in place.
nb::object to_python(const Matrix& matrix, nb::handle owner);

/// Throws Error (problem) that names `what` if the object is not what it should be.
Vector vector_from(nb::handle object, const char* what);
Matrix matrix_from(nb::handle object, const char* what);

}  // namespace fclib::bindings
