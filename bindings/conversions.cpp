#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>

#include <concepts>
#include <optional>
#include <string>
#include <utility>

#include "convert/condense.hpp"
#include "convert/eliminate.hpp"
#include "convert/storage.hpp"
#include "joints/consistent.hpp"
#include "module.hpp"

namespace fclib::bindings {

using namespace nb::literals;

void bind_conversions(nb::module_& m) {
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    const nb::handle cls = m.attr(class_name(P::kind).c_str());
    const auto method = [&](const char* name, auto function, const char* doc) {
      nb::cpp_function_def(
          [function](const P& p) {
            validate(p);
            return function(p);
          },
          nb::scope(cls), nb::name(name), nb::is_method(), nb::call_guard<Unlocked>(), doc);
    };
    if constexpr (std::derived_from<P, GlobalProblem>) {
      method(
          "condense", [](const P& p) { return condense(p); },
          "The local problem: W = H^T M^-1 H, q = H^T M^-1 f + w (and V, R, s from G, b).\n\n"
          "Raises UnsuitableError if M is singular or not positive definite.");
      const std::string pair =
          "def consistent(self) -> tuple[" + class_name(P::kind) + ", str] | None";
      nb::cpp_function_def(
          [](const P& problem) -> std::optional<std::pair<P, std::string>> {
            validate(problem);
            const auto joints = consistent_joints(problem);
            if (!joints) return std::nullopt;
            return std::pair{with(problem, *joints), joints->words()};
          },
          nb::scope(cls), nb::name("consistent"), nb::is_method(), nb::sig(pair.c_str()),
          nb::call_guard<Unlocked>(),
          "The problem that is solved and judged in place of this one, and why, in words: with "
          "joints that agree, if only the rounding of their source makes them contradict each "
          "other. None if nothing is changed.\n\n"
          "Raises UnsuitableError if M is singular.");
    } else {
      method(
          "eliminate", [](const P& p) { return eliminate(p); },
          "The problem without bilateral constraints: W - V R^-1 V^T, q - V R^-1 s.\n\n"
          "Constraints that follow from others are left out.\n\n"
          "Raises UnsuitableError if one contradicts the others (the message names it), or if "
          "R is singular though none follows from the others.");
    }
    const std::string signature = "def with_storage(self, storage: str) -> " + class_name(P::kind);
    nb::cpp_function_def(
        [](const P& problem, const std::string& storage) {
          validate(problem);
          return with_storage(problem, storage_of(storage));
        },
        nb::scope(cls), nb::name("with_storage"), nb::is_method(), nb::sig(signature.c_str()),
        "storage"_a, nb::call_guard<Unlocked>(),
        "The same problem with all matrices in one storage: csr, csc, triplet or dense. "
        "If the storage changes, duplicates are added up.\n\n"
        "Raises OptionError for another name, UnsuitableError if a dense matrix would be too "
        "large, ProblemError if the data is not valid.");
  });
}

}  // namespace fclib::bindings
