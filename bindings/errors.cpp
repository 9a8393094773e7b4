#include <nanobind/stl/string.h>

#include <string>

#include "error.hpp"
#include "module.hpp"
#include "solve/plugin.hpp"

namespace fclib::bindings {

namespace {

PyObject* exception_of[4];
PyObject* solver_error;

void raise(PyObject* type, const Error& error) {
  // a path need not be valid UTF-8
  const std::string text = error.what();
  const nb::object message =
      nb::steal(PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()), "replace"));
  PyErr_SetObject(type, message.ptr());
}

void translate(const std::exception_ptr& pointer, void*) {
  try {
    std::rethrow_exception(pointer);
  } catch (const SolverError& error) {
    raise(solver_error, error);
  } catch (const Error& error) {
    raise(exception_of[static_cast<int>(error.kind)], error);
  }
}

}  // namespace

bool poll_signals() {
  const nb::gil_scoped_acquire gil;
  if (PyErr_CheckSignals() != 0) throw nb::python_error();
  return true;
}

void bind_errors(nb::module_& m) {
  const auto define = [&](const char* name, nb::handle bases, const char* doc) {
    const std::string full = nb::cast<std::string>(m.attr("__name__")) + "." + name;
    const nb::object type =
        nb::steal(PyErr_NewExceptionWithDoc(full.c_str(), doc, bases.ptr(), nullptr));
    m.attr(name) = type;
    return type;
  };
  const nb::object base = define("Error", PyExc_Exception, "Base of all errors of fclib.");
  const auto derive = [&](PyObject*& type, const char* name, PyObject* standard, const char* doc) {
    const nb::tuple bases = nb::make_tuple(base, nb::borrow(standard));
    type = define(name, bases, doc).release().ptr();
  };
  const auto derived = [&](ErrorKind kind, const char* name, PyObject* standard, const char* doc) {
    derive(exception_of[static_cast<int>(kind)], name, standard, doc);
  };
  derived(ErrorKind::file, "FileError", PyExc_OSError,
          "A file cannot be read or written, or is not in the FCLIB layout.");
  derived(ErrorKind::problem, "ProblemError", PyExc_ValueError,
          "The data of a problem or of a solution is not valid.");
  derived(ErrorKind::option, "OptionError", PyExc_ValueError,
          "An unknown solver or option, or a value out of its range.");
  derived(ErrorKind::unsuitable, "UnsuitableError", PyExc_ValueError,
          "What is asked cannot be done for this problem.");
  derive(solver_error, "SolverError", PyExc_RuntimeError,
         "A solver from outside of the core failed: it raised, crashed, or returned no solution.");
  nb::register_exception_translator(translate);
}

}  // namespace fclib::bindings
