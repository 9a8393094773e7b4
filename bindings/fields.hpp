// Python classes from the fields() of a C++ struct: constructor, properties, copies
// with changes, pickling, comparison.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include <string>

#include "arrays.hpp"
#include "error.hpp"
#include "field.hpp"
#include "problem.hpp"
#include "problem_info.hpp"
#include "tables.hpp"

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

/// If the struct has a default for a value, the caller may leave it out.
template <class Struct, class Member>
bool may_be_left_out(const Field<Struct, Member>& field) {
  constexpr bool array = std::is_same_v<Member, Matrix> || std::is_same_v<Member, Vector>;
  return !array || field.presence != Presence::required;
}

/// What is known of the matrices of a problem, by their names.
template <class Struct>
nb::dict matrix_info_of(const Struct& self) {
  nb::dict result;
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    if constexpr (std::is_same_v<Member, Matrix>) {
      const auto& info = (self.*field.member).info;
      if (info) result[std::string(field.name).c_str()] = nb::cast(*info);
    }
  });
  return result;
}

template <class Struct>
void set_matrix_info(Struct& self, nb::handle value) {
  if (!nb::isinstance<nb::mapping>(value)) throw nb::type_error("matrix_info must be a mapping");
  const nb::object builtin = nb::module_::import_("builtins").attr("dict");
  const auto given = nb::borrow<nb::dict>(builtin(value));
  std::size_t used = 0;
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    if constexpr (std::is_same_v<Member, Matrix>) {
      Matrix& a = self.*field.member;
      a.info.reset();
      const std::string name(field.name);
      if (a.empty() || !given.contains(name.c_str())) return;
      ++used;
      if (!nb::try_cast<MatrixInfo>(given[name.c_str()], a.info.emplace())) {
        throw nb::type_error(("matrix_info['" + name + "'] must be of type MatrixInfo").c_str());
      }
    }
  });
  if (used == given.size()) return;
  const nb::dict known = matrix_info_of(self);
  for (const auto& [key, info] : given) {
    if (known.contains(key)) continue;
    throw Error(ErrorKind::problem, "the problem has no such matrix",
                "matrix_info[" + nb::cast<std::string>(nb::repr(key)) + "]");
  }
}

/// Throws Error (problem) if the coefficients of friction that were given are wrong.
///
/// There is one coefficient for each contact. If their number is wrong, later checks would blame
/// the matrices.
template <class P>
void check_friction(const P& problem, const nb::dict& values) {
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    if constexpr (std::is_same_v<Member, Vector>) {
      const std::string name(field.name);
      if (field.rows != Dim::nc || !values.contains(name.c_str())) return;
      const Vector& given = problem.*field.member;
      Index components = 0;
      std::string source;
      if constexpr (requires { problem.W; }) {
        components = problem.W.rows;
        source = "rows of W";
      } else {
        components = problem.H.cols;
        source = "columns of H";
      }
      // another spacedim, or a matrix of another size, is not the fault of mu
      const bool counted = problem.spacedim > 0 && components % problem.spacedim == 0;
      const Index expected = counted ? components / problem.spacedim : -1;
      if (counted && static_cast<Index>(given.size()) != expected) {
        throw Error(ErrorKind::problem,
                    "has " + std::to_string(given.size()) +
                        " entries, expected nc = " + std::to_string(expected) +
                        ", one for each contact: " + source + " " + std::to_string(components) +
                        ", spacedim " + std::to_string(problem.spacedim),
                    name);
      }
      detail::validate_vector(given, static_cast<Index>(given.size()), field.rows, field.range,
                              name);
    }
  });
}

enum class Fill { all, changes };

/// Fills a struct from keyword arguments: all that it needs, or what is to change.
template <class Struct>
void fill(Struct& self, const nb::dict& values, Fill what = Fill::all) {
  std::size_t used = 0;
  [[maybe_unused]] Index before = 0;
  if constexpr (requires { self.info; }) before = self.size(Dim::nc);
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    const std::string name(field.name);
    if (values.contains(name.c_str())) {
      ++used;
      const nb::object value = values[name.c_str()];
      if (value.is_none() && may_be_left_out(field)) {
        self.*field.member = Struct{}.*field.member;
      } else {
        set(field, self, value);
      }
    } else if (what == Fill::all && !may_be_left_out(field)) {
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
    if (values.contains("matrix_info")) {
      ++used;
      set_matrix_info(self, values["matrix_info"]);
    }
    // with another number of contacts, the old geometry does not fit
    if (what == Fill::changes && self.size(Dim::nc) != before) self.geometry.reset();
    Geometry::for_each_table([&](std::string_view table, Geometry::Table Geometry::* member) {
      const std::string name(table);
      if (!values.contains(name.c_str())) return;
      ++used;
      auto changed =
          self.geometry ? std::make_shared<Geometry>(*self.geometry) : std::make_shared<Geometry>();
      (*changed).*member = table_from(values[name.c_str()], table);
      self.geometry = std::move(changed);
    });
    check_friction(self, values);
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
  if constexpr (requires { value.info; }) {
    result["info"] = nb::cast(value.info);
    result["matrix_info"] = matrix_info_of(value);
    Geometry::for_each_table([&](std::string_view table, Geometry::Table Geometry::* member) {
      result[std::string(table).c_str()] = geometry_of<Struct>(self, table, member);
    });
  }
  return result;
}

template <class Struct>
std::string signature_of(const std::string& method, const std::string& result, Fill what) {
  std::string text = "def " + method + "(self, *";
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    constexpr bool array = std::is_same_v<Member, Matrix> || std::is_same_v<Member, Vector>;
    const bool optional = array && may_be_left_out(field);
    text += ", " + std::string(field.name) + ": " + type_name<Member>(true);
    if (optional) text += " | None";
    if (!array || what == Fill::changes) {
      text += " = ...";
    } else if (optional) {
      text += " = None";
    }
  });
  if constexpr (requires(Struct s) { s.info; }) {
    text += ", info: ProblemInfo = ...";
    text += ", matrix_info: collections.abc.Mapping[str, MatrixInfo] = ...";
    text += ", contacts: Contacts | None = ...";
    text += ", bodies: Bodies | None = ...";
  }
  return text + ") -> " + result;
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

/// A constructor by keywords, copies with changes and pickling by the same ones.
template <class Struct>
void def_construction(nb::class_<Struct>& cls) {
  cls.def(
      "__init__",
      [](Struct* self, const nb::kwargs& values) {
        new (self) Struct();
        fill(*self, nb::borrow<nb::dict>(values));
      },
      nb::sig(signature_of<Struct>("__init__", "None", Fill::all).c_str()));
  const auto name = nb::cast<std::string>(cls.attr("__name__"));
  std::string doc = "A copy in which some members are others.";
  if constexpr (requires(Struct s) { s.info; }) doc += " With a matrix goes what was known of it.";
  cls.def(
      "replace",
      [](const Struct& self, const nb::kwargs& values) {
        Struct copy = self;
        fill(copy, nb::borrow<nb::dict>(values), Fill::changes);
        return copy;
      },
      nb::sig(signature_of<Struct>("replace", name, Fill::changes).c_str()), doc.c_str());
}

/// Pickling, and with it copies, by the values of all fields.
template <class Struct>
void def_pickling(nb::class_<Struct>& cls) {
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

inline bool equal(const Vector& a, const Vector& b) {
  return a.size() == b.size() && (a.array() == b.array()).all();
}

/// Whether all members are equal. Two matrices are equal only if they are stored alike.
template <class Struct>
bool equal(const Struct& a, const Struct& b) {
  bool same = true;
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    const Member& one = a.*field.member;
    const Member& other = b.*field.member;
    if constexpr (std::is_same_v<Member, Vector>) {
      same = same && equal(one, other);
    } else {
      same = same && one == other;
    }
  });
  if constexpr (requires { a.geometry; }) {
    static const Geometry nothing;
    const Geometry& one = a.geometry ? *a.geometry : nothing;
    const Geometry& other = b.geometry ? *b.geometry : nothing;
    same = same && a.info == b.info && one.contacts == other.contacts && one.bodies == other.bodies;
  }
  return same;
}

/// Equality, and a hash of what is quickly read: numbers and vectors.
template <class Struct>
void def_equality(nb::class_<Struct>& cls) {
  cls.def(
      "__eq__",
      [](const Struct& self, nb::handle other) {
        return nb::isinstance<Struct>(other) && equal(self, nb::cast<const Struct&>(other));
      },
      nb::arg("other").none(), nb::sig("def __eq__(self, other: object, /) -> bool"));
  cls.def("__hash__", [](const Struct& self) {
    std::size_t hash = 0;
    const auto add = [&](double value) {
      hash = 31 * hash + std::hash<double>{}(value + 0.0);  // -0 equals 0
    };
    for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
      const Member& member = self.*field.member;
      if constexpr (std::is_same_v<Member, Vector>) {
        add(static_cast<double>(member.size()));
        for (const double value : member) add(value);
      } else if constexpr (std::is_arithmetic_v<Member>) {
        add(static_cast<double>(member));
      }
    });
    return static_cast<Py_ssize_t>(hash);
  });
}

/// What notebooks show. fclib._display makes it.
template <class Class>
void def_html(Class& cls) {
  cls.def(
      "_repr_html_",
      [](nb::handle self) { return nb::module_::import_("fclib._display").attr("html")(self); },
      nb::sig("def _repr_html_(self) -> str"));
}

/// Structs of plain values: they are equal if their members are. They are printed as they are made.
template <class Struct>
void def_value(nb::class_<Struct>& cls) {
  cls.def(
      "__eq__",
      [](const Struct& self, nb::handle other) {
        return nb::isinstance<Struct>(other) && self == nb::cast<const Struct&>(other);
      },
      nb::arg("other").none(), nb::sig("def __eq__(self, other: object, /) -> bool"));
  cls.def("__hash__", [](nb::handle self) {
    const nb::object values = to_dict<Struct>(self).values();
    return nb::hash(nb::steal(PySequence_Tuple(values.ptr())));
  });
  cls.def("__repr__", [](nb::handle self) {
    std::string text = nb::cast<std::string>(self.type().attr("__name__")) + "(";
    bool first = true;
    for (const auto& [name, value] : to_dict<Struct>(self)) {
      text += (first ? "" : ", ") + nb::cast<std::string>(name) + "=" +
              nb::cast<std::string>(nb::repr(value));
      first = false;
    }
    return text + ")";
  });
}

}  // namespace fclib::bindings
