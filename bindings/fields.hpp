// Python classes from the fields() of a C++ struct: constructor, properties, repr and pickling.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include <string>

#include "arrays.hpp"
#include "error.hpp"
#include "field.hpp"
#include "problem_info.hpp"

namespace fclib::bindings {

/// The Python type of a member, as it stands in the stubs.
template <class Member>
std::string type_name(bool input) {
  if constexpr (std::is_same_v<Member, Matrix>) {
    return input ? "scipy.sparse.sparray | numpy.typing.NDArray[numpy.float64]"
                 : "scipy.sparse.csr_array | scipy.sparse.csc_array | scipy.sparse.coo_array | "
                   "numpy.typing.NDArray[numpy.float64]";
  } else if constexpr (std::is_same_v<Member, Vector>) {
    return input ? "numpy.typing.ArrayLike" : "numpy.typing.NDArray[numpy.float64]";
  } else if constexpr (std::is_same_v<Member, std::string>) {
    return "str";
  } else if constexpr (std::is_same_v<Member, double>) {
    return "float";
  } else {
    return "int";
  }
}

template <class Struct, class Member>
std::string doc_of(const Field<Struct, Member>& field) {
  std::string doc(field.doc);
  std::string facts;
  if (field.rows != Dim::one) {
    facts = "(" + std::string(name_of(field.rows)) +
            (field.cols == Dim::one ? ",)" : ", " + std::string(name_of(field.cols)) + ")");
  }
  if (!field.unit.empty() && field.unit != "1") {
    facts += std::string(facts.empty() ? "" : " ") + "[" + std::string(field.unit) + "]";
  }
  return facts.empty() ? doc : facts + " " + doc;
}

/// Members that may be missing are None in Python.
template <class Struct, class Member>
bool is_absent(const Field<Struct, Member>& field, const Member& member) {
  if constexpr (std::is_same_v<Member, Matrix>) {
    return field.presence != Presence::required && member.empty();
  } else if constexpr (std::is_same_v<Member, Vector>) {
    return field.presence != Presence::required && member.size() == 0;
  } else {
    return false;
  }
}

template <class Struct, class Member>
nb::object get(const Field<Struct, Member>& field, const Struct& self, nb::handle owner) {
  const Member& member = self.*field.member;
  if (is_absent(field, member)) return nb::none();
  if constexpr (std::is_same_v<Member, Matrix> || std::is_same_v<Member, Vector>) {
    return to_python(member, owner);
  } else if constexpr (std::is_same_v<Member, std::string>) {
    // files hold text of any encoding, and sometimes garbage
    return nb::steal(
        PyUnicode_DecodeUTF8(member.data(), static_cast<Py_ssize_t>(member.size()), "replace"));
  } else {
    return nb::cast(member);
  }
}

template <class Struct, class Member>
void set(const Field<Struct, Member>& field, Struct& self, nb::handle value) {
  const std::string name(field.name);
  if constexpr (std::is_same_v<Member, Matrix>) {
    self.*field.member = matrix_from(value, name.c_str());
  } else if constexpr (std::is_same_v<Member, Vector>) {
    self.*field.member = vector_from(value, name.c_str());
  } else if (!nb::try_cast<Member>(value, self.*field.member)) {
    throw nb::type_error((name + " must be of type " + type_name<Member>(true)).c_str());
  }
}

/// A value may be left out where the struct has a default for it.
template <class Struct, class Member>
bool may_be_left_out(const Field<Struct, Member>& field) {
  constexpr bool array = std::is_same_v<Member, Matrix> || std::is_same_v<Member, Vector>;
  return !array || field.presence != Presence::required;
}

/// Fills a struct from keyword arguments.
template <class Struct>
void fill(Struct& self, const nb::dict& values) {
  std::size_t used = 0;
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    const std::string name(field.name);
    if (values.contains(name.c_str())) {
      ++used;
      const nb::object value = values[name.c_str()];
      if (!(value.is_none() && may_be_left_out(field))) set(field, self, value);
    } else if (!may_be_left_out(field)) {
      throw Error(ErrorKind::problem, "is missing", name);
    }
  });
  if constexpr (requires { self.info; }) {
    if (values.contains("info")) {
      ++used;
      if (!nb::try_cast<ProblemInfo>(values["info"], self.info)) {
        throw nb::type_error("info must be of type ProblemInfo");
      }
    }
  }
  if (used < values.size()) {
    for (const auto& [key, value] : values) {
      bool known = false;
      const auto name = nb::cast<std::string>(key);
      for_each_field<Struct>([&](const auto& field) { known = known || field.name == name; });
      if (!known) throw nb::type_error(("unexpected argument '" + name + "'").c_str());
    }
  }
}

template <class Struct>
nb::dict to_dict(nb::handle self) {
  nb::dict result;
  const auto& value = nb::cast<const Struct&>(self);
  for_each_field<Struct>([&](const auto& field) {
    result[std::string(field.name).c_str()] = get(field, value, self);
  });
  if constexpr (requires { value.info; }) result["info"] = nb::cast(value.info);
  return result;
}

template <class Struct>
std::string signature_of_init() {
  std::string text = "def __init__(self, *";
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    text += ", " + std::string(field.name) + ": " + type_name<Member>(true);
    if constexpr (std::is_same_v<Member, Matrix> || std::is_same_v<Member, Vector>) {
      if (may_be_left_out(field)) text += " | None = None";
    } else {
      text += " = ...";
    }
  });
  if constexpr (requires(Struct s) { s.info; }) text += ", info: ProblemInfo = ...";
  return text + ") -> None";
}

/// Read-only properties for all fields.
template <class Struct>
void def_fields(nb::class_<Struct>& cls) {
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    const std::string name(field.name);
    const std::string doc = doc_of(field);
    std::string type = type_name<Member>(false);
    if constexpr (std::is_same_v<Member, Matrix> || std::is_same_v<Member, Vector>) {
      if (field.presence != Presence::required) type += " | None";
    }
    const std::string signature = "def " + name + "(self, /) -> " + type;
    cls.def_prop_ro(
        name.c_str(),
        [field](nb::handle self) { return get(field, nb::cast<const Struct&>(self), self); },
        nb::sig(signature.c_str()), doc.c_str());
  });
}

/// A constructor by keywords, and pickling by the same ones.
template <class Struct>
void def_construction(nb::class_<Struct>& cls) {
  cls.def(
      "__init__",
      [](Struct* self, const nb::kwargs& values) {
        new (self) Struct();
        fill(*self, nb::borrow<nb::dict>(values));
      },
      nb::sig(signature_of_init<Struct>().c_str()));
  cls.def(
      "__getstate__", [](nb::handle self) { return to_dict<Struct>(self); },
      nb::sig("def __getstate__(self) -> dict[str, object]"));
  cls.def(
      "__setstate__",
      [](Struct& self, const nb::dict& values) {
        new (&self) Struct();
        fill(self, values);
      },
      nb::sig("def __setstate__(self, values: dict[str, object], /) -> None"));
}

}  // namespace fclib::bindings
