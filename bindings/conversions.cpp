#include "conversions.hpp"

#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <filesystem>

#include "convert/storage.hpp"
#include "io/siconos_text.hpp"

namespace fclib::bindings {

namespace nb = nanobind;
using namespace nb::literals;

namespace {

namespace fs = std::filesystem;
using Unlocked = nb::gil_scoped_release;

std::string name_of_class(nb::handle type) {
  return nb::cast<std::string>(nb::handle(type.attr("__name__")));
}

}  // namespace

void bind_siconos(nb::module_& m) {
  std::string problems;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    const nb::handle type = nb::type<P>();
    const std::string name = name_of_class(type);
    problems += (problems.empty() ? "" : " | ") + name;
    const std::string signature = "def with_storage(self, storage: str) -> " + name;
    nb::cpp_function_def(
        [](const P& problem, const std::string& storage) {
          validate(problem);
          return with_storage(problem, storage_of(storage));
        },
        nb::scope(type), nb::name("with_storage"), nb::is_method(), nb::sig(signature.c_str()),
        "storage"_a, nb::call_guard<Unlocked>(),
        "The same problem with all matrices in one storage: csr, csc, triplet or dense. "
        "Duplicates are added up where the storage changes.\n\n"
        "Raises OptionError for another name, UnsuitableError where a dense matrix would be too "
        "large, ProblemError where the data is not valid.");
    m.def(
        "write_siconos",
        [](const fs::path& path, const P& problem) { write_siconos(path.string(), &problem); },
        "path"_a, "problem"_a,
        nb::sig(("def write_siconos(path: str | os.PathLike[str], problem: " + name + ") -> None")
                    .c_str()),
        nb::call_guard<Unlocked>(),
        "Writes a problem in Siconos' text format (\".dat\"), or replaces the old file whole, "
        "atomically. Every number reads back equal. Matrices keep their storage; W by rows is "
        "written in blocks, other matrices by rows are written by columns. The format has no "
        "place for bilateral constraints, solutions and info.\n\n"
        "Raises UnsuitableError where there are bilateral constraints, FileError, or ProblemError "
        "where the data is not valid.");
  });
  m.def(
      "read_siconos",
      [](const fs::path& path, const std::optional<std::string>& kind) {
        Problem problem = [&] {
          const Unlocked unlocked;
          return read_siconos(path.string(), kind.value_or(""));
        }();
        return std::visit([](auto& p) { return nb::cast(std::move(p)); }, problem);
      },
      "path"_a, "kind"_a = nb::none(),
      nb::sig(
          ("def read_siconos(path: str | os.PathLike[str], kind: str | None = None) -> " + problems)
              .c_str()),
      "The problem in a text file of Siconos (\".dat\"), validated. What it holds is told from its "
      "sizes, or by `kind` (\"local\", \"global\", \"local_rolling\", \"global_rolling\").\n\n"
      "Raises FileError, naming file and line, ProblemError, or OptionError where there is no such "
      "kind.");
}

}  // namespace fclib::bindings
