// Arrays of NumPy as they lie: no copy, and no call of NumPy.
//
// A time step hands over dozens of small arrays. nanobind's own arrays take longer than the
// numbers.
#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "module.hpp"

namespace fclib::bindings {

/// The numbers of an array, as long as this lives. TypeError if they are of another type.
template <class Number>
class Buffer {
 public:
  Buffer(nb::handle array, const char* what) {
    get(array, PyBUF_FORMAT);
    const std::string_view types = std::is_floating_point_v<Number> ? "d" : "ilq";
    const std::string_view format = view_.format == nullptr ? "" : view_.format;
    const bool known = format.size() == 1 && types.find(format.front()) != types.npos;
    if (!known || view_.itemsize != static_cast<Py_ssize_t>(sizeof(Number)) || view_.ndim < 1) {
      PyBuffer_Release(&view_);
      throw nb::type_error((std::string(what) + ": an array of other numbers").c_str());
    }
  }
  /// Of an array that is known to have these numbers.
  explicit Buffer(nb::handle array) { get(array, 0); }
  ~Buffer() { PyBuffer_Release(&view_); }
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;

  [[nodiscard]] Number* data() const { return static_cast<Number*>(view_.buf); }
  /// Along the first axis.
  [[nodiscard]] std::size_t rows() const { return static_cast<std::size_t>(view_.shape[0]); }
  /// The lengths of the axes after the first one.
  [[nodiscard]] std::span<const Py_ssize_t> axes() const {
    return {view_.shape + 1, static_cast<std::size_t>(view_.ndim - 1)};
  }
  /// Numbers from row to row.
  [[nodiscard]] std::ptrdiff_t step() const {
    return view_.strides[0] / static_cast<std::ptrdiff_t>(sizeof(Number));
  }
  /// Whether each row is in one piece.
  [[nodiscard]] bool has_whole_rows() const {
    Py_ssize_t size = view_.itemsize;
    for (int axis = view_.ndim - 1; axis > 0; --axis) {
      if (view_.shape[axis] > 1 && view_.strides[axis] != size) return false;
      size *= view_.shape[axis];
    }
    return true;
  }
  /// All numbers, row after row. TypeError if they do not lie so.
  [[nodiscard]] std::span<Number> all() const {
    if (!PyBuffer_IsContiguous(&view_, 'C')) throw nb::type_error("an array is not contiguous");
    return {data(), static_cast<std::size_t>(view_.len) / sizeof(Number)};
  }

 private:
  void get(nb::handle array, int flags) {
    constexpr int writable = std::is_const_v<Number> ? 0 : PyBUF_WRITABLE;
    if (PyObject_GetBuffer(array.ptr(), &view_, PyBUF_STRIDES | writable | flags) != 0) {
      throw nb::python_error();
    }
  }

  Py_buffer view_{};
};

}  // namespace fclib::bindings
