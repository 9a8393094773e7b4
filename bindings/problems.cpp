#include <cctype>
#include <string>

#include "fields.hpp"
#include "module.hpp"
#include "problem.hpp"

namespace fclib::bindings {

/// "LocalProblem" for the kind "local".
std::string class_name(std::string_view kind) {
  std::string name;
  bool initial = true;
  for (const char c : kind) {
    if (c == '_') {
      initial = true;
      continue;
    }
    name += initial ? static_cast<char>(std::toupper(c)) : c;
    initial = false;
  }
  return name + "Problem";
}

/// "GlobalProblem | LocalProblem"
std::string problem_union() {
  std::string names;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    names += (names.empty() ? "" : " | ") + class_name(P::kind);
  });
  return names;
}

namespace {

template <class P>
void bind_problem(nb::module_& m) {
  const std::string name = class_name(P::kind);
  nb::class_<P> cls(m, name.c_str(), P::doc);
  def_construction(cls);
  def_pickling(cls);
  def_fields(cls);
  def_equality(cls);
  def_html(cls);
  cls.def(
      "view",
      [](nb::handle self, nb::handle solution) {
        return nb::module_::import_("fclib.notebook").attr("view")(self, solution);
      },
      nb::arg("solution") = nb::none(),
      nb::sig("def view(self, solution: Solution | Result | None = None) -> Any"),
      "Contacts and bodies in space, for a notebook, with the reactions of a solution if one is\n"
      "given. See fclib.notebook.view.");
  cls.def_prop_ro("info", [](const P& p) { return p.info; }, "title, description, math_info");
  cls.def_prop_ro(
      "matrix_info",
      [](const P& p) {
        return nb::module_::import_("types").attr("MappingProxyType")(matrix_info_of(p));
      },
      nb::sig("def matrix_info(self, /) -> collections.abc.Mapping[str, MatrixInfo]"),
      "What is known of a matrix and cannot be read off its entries, by its name: "
      "matrix_info[\"W\"].rank. Matrices of which nothing is known are left out.");
  Geometry::for_each_table([&](std::string_view table, Geometry::Table Geometry::* member) {
    const std::string own(table);
    const std::string type = "def " + own + "(self, /) -> " + geometry_class(own) + " | None";
    cls.def_prop_ro(
        own.c_str(), [own, member](nb::handle self) { return geometry_of<P>(self, own, member); },
        nb::sig(type.c_str()),
        own == "contacts" ? "where each contact is, and between what; None if it is not known"
                          : "the bodies, their shapes and where they are; None if not known");
  });
  const auto def_size = [&](const char* dim_name, Dim dim, const char* doc) {
    cls.def_prop_ro(dim_name, [dim](const P& p) { return p.size(dim); }, doc);
  };
  def_size("n", Dim::n, "degrees of freedom (0 for a local problem)");
  def_size("m", Dim::m, "local unknowns, spacedim * nc");
  def_size("p", Dim::p, "bilateral constraints");
  def_size("nc", Dim::nc, "contacts");
  cls.def_prop_ro(
      "formulation", [](const P& p) { return formulation(p); },
      "the name of the formulation in RT-0444: 3DFC, GM3DFC, ...");
  cls.def_prop_ro(
      "kind", [](const P&) { return std::string(P::kind); },
      "the kind of the problem, which names its class and its group in a file");
  cls.def(
      "validate", [](const P& p) { validate(p); }, nb::call_guard<Unlocked>(),
      "Raises ProblemError at the first thing wrong with the data.");
  cls.def("__repr__", [name](const P& p) {
    std::string text =
        "<" + name + " " + formulation(p) + ": nc = " + std::to_string(p.size(Dim::nc));
    if (p.size(Dim::n) > 0) text += ", n = " + std::to_string(p.size(Dim::n));
    if (p.size(Dim::p) > 0) text += ", p = " + std::to_string(p.size(Dim::p));
    return text + ">";
  });
}

}  // namespace

void bind_problems(nb::module_& m) {
  nb::class_<ProblemInfo> info(m, "ProblemInfo", "What a file says about its problem in words.");
  def_construction(info);
  def_pickling(info);
  def_fields(info);
  def_value(info);
  nb::class_<MatrixInfo> matrix_info(
      m, "MatrixInfo", "What is known of a matrix and cannot be read off its entries.");
  def_construction(matrix_info);
  def_pickling(matrix_info);
  def_fields(matrix_info);
  def_value(matrix_info);
  nb::class_<Solution> solution(m, "Solution", "A solution, or a guess, of any formulation.");
  def_construction(solution);
  def_pickling(solution);
  def_fields(solution);
  def_equality(solution);
  def_html(solution);
  solution.def("__repr__", [](const Solution& self) {
    std::string text;
    for_each_field<Solution>([&](const auto& field) {
      const Vector& values = self.*field.member;
      if (values.size() == 0 && field.name != "r") return;
      text += (text.empty() ? "" : ", ") + std::string(field.name) + " (" +
              std::to_string(values.size()) + ",)";
    });
    return "<Solution: " + text + ">";
  });
  for_each_formulation([&]<class P>(std::type_identity<P>) { bind_problem<P>(m); });
}

}  // namespace fclib::bindings
