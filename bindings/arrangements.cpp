#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <string>

#include "convert/component_order.hpp"
#include "convert/embed.hpp"
#include "convert/islands.hpp"
#include "convert/units.hpp"
#include "fields.hpp"
#include "module.hpp"

namespace fclib::bindings {

using namespace nb::literals;

namespace {

constexpr const char* order_type =
    "order: typing.Literal['normal-first', 'normal-last', "
    "'normals-first']";
constexpr const char* scaling_type =
    "velocity: float = 1.0, impulse: float = 1.0, length: float = 1.0";

void bind_islands(nb::module_& m) {
  nb::class_<Islands> cls(
      m, "Islands",
      "Groups of contacts, degrees of freedom and bilateral constraints that nothing links. They "
      "are numbered by their first contact; all that touches no contact is one more, the last.");
  cls.def_ro("count", &Islands::count, "how many there are");
  const auto numbers = [&](const char* name, auto member, const char* doc) {
    cls.def_prop_ro(
        name,
        [member](nb::handle self) {
          const auto& values = nb::cast<const Islands&>(self).*member;
          return view(values.data(), values.size(), self);
        },
        nb::for_getter(
            nb::sig(("def " + std::string(name) + "(self, /) -> numpy.typing.NDArray[numpy.int32]")
                        .c_str())),
        doc);
  };
  numbers("contact", &Islands::contact, "(nc,) the island of each contact");
  numbers("dof", &Islands::dof, "(n,) the island of each degree of freedom");
  numbers("bilateral", &Islands::bilateral, "(p,) the island of each bilateral constraint");
  cls.def(
      "__getstate__",
      [](const Islands& self) {
        return std::tuple(self.count, self.spacedim, self.contact, self.dof, self.bilateral);
      },
      nb::sig("def __getstate__(self) -> tuple[object, ...]"));
  cls.def(
      "__setstate__",
      [](Islands& self, const std::tuple<Index, Index, std::vector<Index>, std::vector<Index>,
                                         std::vector<Index>>& state) {
        const auto& [count, spacedim, contact, dof, bilateral] = state;
        new (&self) Islands{count, spacedim, contact, dof, bilateral};
      },
      nb::sig("def __setstate__(self, state: tuple[object, ...], /) -> None"));
  cls.def("__repr__",
          [](const Islands& self) { return "<Islands: " + std::to_string(self.count) + ">"; });

  const auto both = [&]<class T>(std::type_identity<T>, const std::string& name,
                                 const char* split_doc, const char* merge_doc) {
    cls.def(
        "split", [](const Islands& self, const T& whole) { return split(whole, self); }, "whole"_a,
        nb::sig(("def split(self, whole: " + name + ") -> list[" + name + "]").c_str()),
        nb::call_guard<Unlocked>(), split_doc);
    cls.def(
        "merge",
        [](const Islands& self, const std::vector<T>& parts) { return merge(parts, self); },
        "parts"_a,
        nb::sig(
            ("def merge(self, parts: collections.abc.Sequence[" + name + "]) -> " + name).c_str()),
        nb::call_guard<Unlocked>(), merge_doc);
  };
  for_each_formulation([&]<class P>(std::type_identity<P> type) {
    const std::string name = class_name(P::kind);
    both(type, name,
         "The problem of each island. Raises ProblemError if the sizes are not those of the "
         "islands, or an entry links two of them.",
         "The problem that has these as its islands. Raises ProblemError if the sizes "
         "disagree.");
    nb::cpp_function_def(
        [](const P& problem) {
          validate(problem);
          return islands(problem);
        },
        nb::scope(nb::type<P>()), nb::name("islands"), nb::is_method(), nb::call_guard<Unlocked>(),
        "The connected components: entries that are stored and zero link nothing.");
    m.def(
        "merge", [](const std::vector<P>& problems) { return merge(problems, beside(problems)); },
        "problems"_a,
        nb::sig(("def merge(problems: collections.abc.Sequence[" + name + "]) -> " + name).c_str()),
        nb::call_guard<Unlocked>(),
        "Independent problems as one, one after the other.\n\n"
        "Raises ProblemError if there is none, or if their spacedims differ.");
  });
  both(std::type_identity<Solution>{}, "Solution", "The solution of each island.",
       "The solution of the whole from those of its islands.");
}

template <class P>
void bind_order(nb::handle type, const std::string& name) {
  nb::cpp_function_def(
      [](const P& problem, const std::string& order) {
        const P data = [&] {
          const Unlocked unlocked;
          validate(problem);
          return to_order(problem, component_order_of(order));
        }();
        nb::dict values = to_dict<P>(nb::cast(data));
        nb::del(values["info"]);
        nb::del(values["matrix_info"]);
        return values;
      },
      nb::scope(type), nb::name("to_order"), nb::is_method(), "order"_a,
      nb::sig(
          ("def to_order(self, " + std::string(order_type) + ") -> dict[str, typing.Any]").c_str()),
      "The arrays by their names, with the components of contacts in the order of another tool: "
      "normal-last (T1, T2, N) as Pinocchio and ContactBench, normals-first (all N, then all T) as "
      "linear complementarity problems; MuJoCo's order is ours, normal-first.\n\n"
      "Raises OptionError for another order.");
  const nb::object function = nb::cpp_function(
      [](const std::string& order, const nb::kwargs& values) {
        P data;
        fill(data, nb::borrow<nb::dict>(values));
        validate(data);
        return from_order(data, component_order_of(order));
      },
      "order"_a, "values"_a,
      nb::sig(("def from_order(" + std::string(order_type) + ", **values: typing.Any) -> " + name)
                  .c_str()),
      "The problem whose data, as for the constructor, is in the order of another tool.\n\n"
      "Raises ProblemError if the data is not valid, OptionError for another order.");
  type.attr("from_order") = nb::module_::import_("builtins").attr("staticmethod")(function);
}

template <class P>
void bind_methods(nb::class_<Solution>& solution) {
  const nb::handle type = nb::type<P>();
  const std::string name = class_name(P::kind);
  if constexpr (!P::rolling && !P::spin) bind_order<P>(type, name);
  nb::cpp_function_def(
      [](const P& problem) {
        validate(problem);
        return embed(problem);
      },
      nb::scope(type), nb::name("embed"), nb::is_method(), nb::call_guard<Unlocked>(),
      "The spatial problem of a planar one: (N, T) becomes (N, T, 0). The new components have "
      "masses of their own and stay at rest.\n\n"
      "Raises UnsuitableError if the problem is not planar.");
  nb::cpp_function_def(
      [](const P& problem, double velocity, double impulse, double length) {
        validate(problem);
        return scaled(problem, {velocity, impulse, length});
      },
      nb::scope(type), nb::name("scaled"), nb::is_method(), nb::kw_only(), "velocity"_a = 1.0,
      "impulse"_a = 1.0, "length"_a = 1.0, nb::call_guard<Unlocked>(),
      nb::sig(("def scaled(self, *, " + std::string(scaling_type) + ") -> " + name).c_str()),
      "The problem in other units: a velocity of 1 becomes `velocity`, an impulse of 1 `impulse`, "
      "and, for rolling or spin friction, a length of 1 `length`.\n\n"
      "Raises OptionError if a factor is not positive.");
  const auto argument = [&](const char* method, const char* more) {
    return "def " + std::string(method) + "(self, problem: " + name + more + ") -> Solution";
  };
  solution.def(
      "embed", [](const Solution& self, const P& planar) { return embed(self, planar); },
      "problem"_a, nb::sig(argument("embed", "").c_str()), nb::call_guard<Unlocked>(),
      "The solution of problem.embed() from that of the planar problem.");
  solution.def(
      "flatten", [](const Solution& self, const P& planar) { return flatten(self, planar); },
      "problem"_a, nb::sig(argument("flatten", "").c_str()), nb::call_guard<Unlocked>(),
      "The solution of the planar problem from that of problem.embed().");
  solution.def(
      "scaled",
      [](const Solution& self, const P& problem, double velocity, double impulse, double length) {
        return scaled(self, problem, {velocity, impulse, length});
      },
      "problem"_a, nb::kw_only(), "velocity"_a = 1.0, "impulse"_a = 1.0, "length"_a = 1.0,
      nb::sig(argument("scaled", (", *, " + std::string(scaling_type)).c_str()).c_str()),
      nb::call_guard<Unlocked>(), "The solution of problem.scaled() from that of the problem.");
}

}  // namespace

void bind_arrangements(nb::module_& m) {
  bind_islands(m);
  auto solution = nb::borrow<nb::class_<Solution>>(nb::type<Solution>());
  for_each_formulation([&]<class P>(std::type_identity<P>) { bind_methods<P>(solution); });
  m.def(
      "component_order",
      [](const std::string& order, Index nc, Index spacedim) {
        if (nc < 0 || spacedim < 1) {
          throw Error(ErrorKind::option, "nc and spacedim must not be negative", "component_order");
        }
        const std::vector<Index> to = component_places(component_order_of(order), nc, spacedim).to;
        std::vector<Index> from(to.size());
        for (std::size_t k = 0; k < to.size(); ++k) from[to[k]] = static_cast<Index>(k);
        return view(from.data(), from.size(), nb::handle()).attr("copy")();
      },
      "order"_a, "nc"_a, "spacedim"_a = 3,
      nb::sig(("def component_order(" + std::string(order_type) +
               ", nc: int, spacedim: int = 3) -> numpy.typing.NDArray[numpy.int32]")
                  .c_str()),
      "The index k (spacedim * nc) of the components of contacts in the order of another tool: "
      "theirs = ours[k], ours[k] = theirs.\n\nRaises OptionError for another order.");
}

}  // namespace fclib::bindings
