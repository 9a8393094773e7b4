#include <nanobind/stl/string.h>

#include <cstdio>
#include <string>

#include "fields.hpp"
#include "merit/merit.hpp"
#include "merit/merit_1.hpp"
#include "module.hpp"

namespace fclib::bindings {

using namespace nb::literals;

namespace {

/// `judge` of a problem and of what the caller gave as a solution, without Python's lock.
template <class P, class Judge>
auto judged(const P& problem, const nb::object& given, const Judge& judge) {
  const Solution solution = solution_from(given, "solution");
  const Unlocked unlocked;
  return judge(problem, solution);
}

}  // namespace

void bind_merits(nb::module_& m) {
  nb::class_<Merit> merit_class(m, "Merit", "How good a solution is, judged from the data alone.");
  def_fields(merit_class);
  def_pickling(merit_class);
  def_equality(merit_class);
  def_html(merit_class);
  merit_class.def("__repr__", [](const Merit& self) {
    char text[160];
    std::snprintf(text, sizeof text,
                  "<Merit: error %.1e, natural %.1e, scaled %.1e; %d open, %d stick, %d slide>",
                  self.error, self.natural, self.scaled_natural, static_cast<int>(self.open),
                  static_cast<int>(self.stick), static_cast<int>(self.slide));
    return std::string(text);
  });
  merit_class.def(
      "error_by",
      [](const Merit& merit, const std::string& kind) {
        if (kind != "both" && kind != "natural") {
          throw Error(ErrorKind::option, "'" + kind + "' is neither both nor natural", "merit");
        }
        return merit.error_by(kind == "both" ? MeritKind::both : MeritKind::natural);
      },
      "merit"_a,
      "error if merit is 'both'. If it is 'natural', the error without scaled_natural.\n\n"
      "Raises OptionError for anything else.");
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    const auto signature = [](const std::string& name, const std::string& result) {
      return "def " + name + "(problem: " + class_name(P::kind) + ", solution: " + solution_type +
             ") -> " + result;
    };
    m.def(
        "merit_1",
        [](const P& problem, const nb::object& given) {
          return judged(problem, given, [](const auto& p, const auto& s) { return merit_1(p, s); });
        },
        "problem"_a, "solution"_a, nb::sig(signature("merit_1", "float").c_str()),
        "What libfclib calls MERIT_1, for comparisons with it.\n\n"
        "Raises ProblemError if the problem or the solution is not valid.");
    m.def(
        "contact_merits",
        [](const P& problem, const nb::object& given) {
          const ContactMerits merits = judged(
              problem, given, [](const auto& p, const auto& s) { return contact_merits(p, s); });
          nb::list status;
          for (const ContactStatus one : merits.status) {
            status.append(one == ContactStatus::open    ? "open"
                          : one == ContactStatus::stick ? "stick"
                                                        : "slide");
          }
          const auto array = [](const Vector& values) {
            return to_python(values, nb::handle()).attr("copy")();
          };
          nb::dict result;
          result["status"] = nb::module_::import_("numpy").attr("array")(status, "dtype"_a = "U5");
          result["u"] = array(merits.u);
          result["natural"] = array(merits.natural);
          result["cone"] = array(merits.cone);
          result["dual_cone"] = array(merits.dual_cone);
          nb::list mismatches;
          for (const Mismatch& one : merits.mismatches) {
            nb::dict row;
            row["part"] = std::string(one.part);
            row["index"] = one.index;
            row["stored"] = one.stored;
            row["difference"] = one.difference;
            row["error"] = one.error;
            mismatches.append(row);
          }
          result["mismatches"] = mismatches;
          return result;
        },
        "problem"_a, "solution"_a,
        nb::sig(signature("contact_merits", "dict[str, typing.Any]").c_str()),
        "The merit of each contact, as a dict:\n\n"
        "- status (nc,): open, stick or slide;\n"
        "- natural (nc,): ||r - P_K(r - u^)||;\n"
        "- cone, dual_cone (nc,): the distances of r from K and of u^ from K*;\n"
        "- u (m,): the velocities, computed again from r;\n"
        "- mismatches: a list. It has a dict for each of v, u and l that the solution stores, "
        "about "
        "the worst component of it: part, index, stored, difference and error. The difference is "
        "that of the stored value and the computed one (for l: the velocity that is left at the "
        "joint). The error is the part of it that is not rounding, over the velocity of the "
        "component.\n\n"
        "Raises ProblemError if the problem or the solution is not valid.");
    m.def(
        "merit",
        [](const P& problem, const nb::object& given) {
          return judged(problem, given, [](const auto& p, const auto& s) { return merit(p, s); });
        },
        "problem"_a, "solution"_a, nb::sig(signature("merit", "Merit").c_str()),
        "The merit of a solution, which may be a Result, or the reactions alone. A missing v is "
        "computed, a missing u is not judged.\n\n"
        "Raises ProblemError if the problem or the solution is not valid.");
  });
}

}  // namespace fclib::bindings
