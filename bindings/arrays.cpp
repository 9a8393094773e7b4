#include "arrays.hpp"

#include <nanobind/stl/string.h>

#include <limits>
#include <memory>
#include <string>

#include "error.hpp"
#include "linalg/places.hpp"
#include "module.hpp"

namespace fclib::bindings {

using namespace nanobind::literals;

namespace {

template <class Number>
using Contiguous = nb::ndarray<const Number, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

[[noreturn]] void unfit(const char* what, const std::string& message) {
  throw Error(ErrorKind::problem, message, what);
}

/// Whether the object is an array of NumPy itself: those of subclasses may have hidden entries.
bool is_plain_array(nb::handle object) {
  static const nb::handle array =
      nb::object(nb::module_::import_("numpy").attr("ndarray")).release();
  return object.type().is(array);
}

/// The object as a contiguous NumPy array of a type. It is copied only if it is not one already.
nb::object as_array(nb::handle object, const char* type, const char* what) {
  const nb::module_ numpy = nb::module_::import_("numpy");
  try {
    const nb::object array = numpy.attr("asarray")(object);
    const auto kind = nb::cast<std::string>(array.attr("dtype").attr("kind"));
    if (kind.find_first_of("biuf") == std::string::npos) {
      unfit(what, "is not an array of real numbers");
    }
    // asarray takes the hidden entries of a masked array as its values
    if (!array.is(object) && nb::hasattr(object, "mask") &&
        nb::cast<bool>(numpy.attr("ma").attr("is_masked")(object))) {
      unfit(what, "has masked entries");
    }
    return numpy.attr("ascontiguousarray")(array, type);
  } catch (const nb::python_error&) {
    unfit(what, "is not an array of numbers");
  }
}

template <class Number>
Contiguous<Number> as_contiguous(nb::handle object, const char* type, const char* what) {
  // NumPy's functions take longer than a copy of the entries of a few bodies
  Contiguous<Number> found;
  if (is_plain_array(object) && nb::try_cast(object, found, false)) return found;
  const nb::object array = as_array(object, type, what);
  if (nb::cast<int>(array.attr("ndim")) != 1) unfit(what, "is not one-dimensional");
  return nb::cast<Contiguous<Number>>(array);
}

std::vector<Index> indices_from(nb::handle object, const char* what) {
  Contiguous<Index> own;
  if (is_plain_array(object) && nb::try_cast(object, own, false)) {
    return {own.data(), own.data() + own.shape(0)};
  }
  const auto array = as_contiguous<std::int64_t>(object, "int64", what);
  std::vector<Index> result(array.shape(0));
  for (std::size_t k = 0; k < result.size(); ++k) {
    if (array.data()[k] != static_cast<Index>(array.data()[k])) {
      unfit(what, "an index does not fit 32 bits");
    }
    result[k] = static_cast<Index>(array.data()[k]);
  }
  return result;
}

std::vector<double> values_from(nb::handle object, const char* what) {
  const auto array = as_contiguous<double>(object, "float64", what);
  return {array.data(), array.data() + array.shape(0)};
}

/// As csr; SciPy itself follows the indices of blocks before they are here to be looked at.
nb::object as_rows(const nb::object& matrix, const std::string& format, const char* what) {
  try {
    if (format == "bsr") matrix.attr("check_format")(nb::arg("full_check") = true);
    return matrix.attr("tocsr")();
  } catch (nb::python_error& error) {
    if (!error.matches(PyExc_ValueError)) throw;
    unfit(what, nb::cast<std::string>(nb::str(error.value())));
  }
}

Index size_from(nb::handle object, const char* what) {
  const auto size = nb::cast<std::int64_t>(object);
  if (size > std::numeric_limits<Index>::max()) unfit(what, "a size does not fit 32 bits");
  return static_cast<Index>(size);
}

}  // namespace

nb::object to_python(const Vector& vector, nb::handle owner) {
  return view(vector.data(), static_cast<std::size_t>(vector.size()), owner);
}

nb::object to_python(const Matrix& a, nb::handle owner) {
  if (a.storage == Storage::dense) {
    static const double nothing{};
    const std::size_t shape[2] = {static_cast<std::size_t>(a.rows),
                                  static_cast<std::size_t>(a.cols)};
    return nb::cast(nb::ndarray<nb::numpy, const double, nb::ndim<2>, nb::f_contig>(
        a.x.empty() ? &nothing : a.x.data(), 2, shape, owner, nullptr, nb::dtype<double>(),
        nb::device::cpu::value, 0, 'F'));
  }
  const nb::module_ sparse = nb::module_::import_("scipy.sparse");
  const nb::object values = view(a.x.data(), a.x.size(), owner);
  const nb::object inner = view(a.i.data(), a.i.size(), owner);
  const nb::object outer = view(a.p.data(), a.p.size(), owner);
  const nb::tuple shape = nb::make_tuple(a.rows, a.cols);
  if (a.storage == Storage::triplet) {
    return sparse.attr("coo_array")(nb::make_tuple(values, nb::make_tuple(inner, outer)),
                                    nb::arg("shape") = shape);
  }
  const bool canonical = is_canonical(a);
  const nb::object result = sparse.attr(a.storage == Storage::csc ? "csc_array" : "csr_array")(
      nb::make_tuple(values, inner, outer), nb::arg("shape") = shape, nb::arg("copy") = !canonical);
  if (canonical) {
    result.attr("has_sorted_indices") = true;
    result.attr("has_canonical_format") = true;
  }
  return result;
}

Vector vector_from(nb::handle object, const char* what) {
  const auto array = as_contiguous<double>(object, "float64", what);
  return Eigen::Map<const Vector>(array.data(), static_cast<Eigen::Index>(array.shape(0)));
}

Matrix matrix_from(nb::handle object, const char* what) {
  Matrix a;
  if (!nb::hasattr(object, "tocsr")) {
    const nb::object array = as_array(object, "float64", what);
    if (nb::cast<int>(array.attr("ndim")) != 2) unfit(what, "is not a matrix");
    a.storage = Storage::dense;
    a.rows = size_from(array.attr("shape")[0], what);
    a.cols = size_from(array.attr("shape")[1], what);
    a.x = values_from(array.attr("ravel")("F"), what);
    return a;
  }
  nb::object source = nb::borrow(object);
  auto format = nb::cast<std::string>(source.attr("format"));
  if (format != "csr" && format != "csc" && format != "coo") {
    source = as_rows(source, format, what);
    format = "csr";
  }
  if (nb::cast<int>(source.attr("ndim")) != 2) unfit(what, "is not a matrix");
  a.rows = size_from(source.attr("shape")[0], what);
  a.cols = size_from(source.attr("shape")[1], what);
  if (format == "coo") {
    a.storage = Storage::triplet;
    a.i = indices_from(source.attr("row"), what);
    a.p = indices_from(source.attr("col"), what);
  } else {
    a.storage = format == "csc" ? Storage::csc : Storage::csr;
    a.i = indices_from(source.attr("indices"), what);
    a.p = indices_from(source.attr("indptr"), what);
  }
  a.x = values_from(source.attr("data"), what);
  // SciPy may leave room at the end of its arrays
  if (a.storage != Storage::triplet && !a.p.empty()) {
    const auto used = static_cast<std::size_t>(a.p.back());
    require_counted(a.x, used, std::string(what) + ".indptr");
    if (used < a.i.size()) a.i.resize(used);
    if (used < a.x.size()) a.x.resize(used);
  }
  validate_places(a, what);  // SciPy itself does not check these indices
  return a;
}

void bind_arrays(nb::module_& m) {
  m.def(
      "matrix_from",
      [](const nb::object& given, const std::string& what) {
        auto own = std::make_unique<Matrix>(matrix_from(given, what.c_str()));
        const Matrix& matrix = *own;
        const nb::capsule owner(own.release(),
                                [](void* a) noexcept { delete static_cast<Matrix*>(a); });
        return to_python(matrix, owner);
      },
      "given"_a, "what"_a, nb::sig("def matrix_from(given: Any, what: str) -> Any"),
      "A copy of a matrix of SciPy or NumPy, whose indices are in its shape. SciPy itself does not "
      "look, and reads beyond its arrays.\n\n"
      "Raises ProblemError, by the name of what it is, for anything else.");
}

}  // namespace fclib::bindings
