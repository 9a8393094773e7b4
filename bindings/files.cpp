#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <filesystem>
#include <initializer_list>
#include <string>

#include "convert/complete.hpp"
#include "io/hdf5/hdf5.hpp"
#include "io/replace_file.hpp"
#include "io/siconos/siconos.hpp"
#include "merit/merit.hpp"
#include "module.hpp"

namespace fclib::bindings {

using namespace nb::literals;

namespace {

namespace fs = std::filesystem;

constexpr const char* path_type = "path: str | os.PathLike[str]";

std::string signature(const std::string& name, const std::string& rest, const std::string& result) {
  return "def " + name + "(" + path_type + rest + ") -> " + result;
}

const std::string guesses_type = "guesses: " + solutions_type;
const std::string compression_type =
    "compression: int = " + std::to_string(WriteOptions{}.compression);

/// The options of a mode's name.
WriteOptions options_of(const std::string& mode, std::initializer_list<std::string_view> modes,
                        int compression) {
  std::string known;
  for (const auto name : modes) known += (known.empty() ? "" : ", ") + std::string(name);
  if (std::find(modes.begin(), modes.end(), mode) == modes.end()) {
    throw Error(ErrorKind::option, "there is no mode '" + mode + "'; there are: " + known, "mode");
  }
  return {.append = mode != "overwrite", .replace = mode == "replace", .compression = compression};
}

/// The problem that the solution and the guesses of a file belong to.
Problem read_owner(const std::string& path) {
  const Problem outline = read_outline(path);
  return read_problem(path, std::visit([]<class P>(const P&) { return P::kind; }, outline));
}

/// Guesses with all members that readers of libfclib 3.1 need.
template <class P>
std::vector<Solution> complete(const P& problem, const std::vector<Solution>& guesses) {
  std::vector<Solution> result;
  for (const auto& guess : guesses) {
    validate(guess, problem, guess_path(result.size() + 1));
    result.push_back(fclib::complete(problem, guess));
  }
  return result;
}

void bind_hdf5(nb::module_& m) {
  m.def(
      "sync_files", [](const fs::path& folder) { sync_files(folder.string()); }, "folder"_a,
      nb::sig("def sync_files(folder: str | os.PathLike[str]) -> None"), nb::call_guard<Unlocked>(),
      "Flushes all files on the file system of a folder. Raises FileError.");
  m.def(
      "read",
      [](const fs::path& path, const std::optional<std::string>& kind) {
        Problem problem = [&] {
          const Unlocked unlocked;
          return read_problem(path.string(), kind.value_or(""));
        }();
        return std::visit([](auto& p) { return nb::cast(std::move(p)); }, problem);
      },
      "path"_a, "kind"_a = nb::none(),
      nb::sig(signature("read", ", kind: str | None = None", problem_union()).c_str()),
      "The problem in an FCLIB file, validated. `kind` (\"local\", \"global\") chooses if the "
      "file holds several.\n\nRaises FileError, or ProblemError, naming file and dataset.");
  m.def(
      "read_solution", [](const fs::path& path) { return read_solution(path.string()); }, "path"_a,
      nb::sig(signature("read_solution", "", "Solution | None").c_str()),
      nb::call_guard<Unlocked>(),
      "The stored solution of a file, or None. It is that of the global problem if the file "
      "holds several. Raises FileError.");
  m.def(
      "read_guesses", [](const fs::path& path) { return read_guesses(path.string()); }, "path"_a,
      nb::sig(signature("read_guesses", "", "list[Solution]").c_str()), nb::call_guard<Unlocked>(),
      "The stored guesses of a file, of the problem that a solution would belong to. Raises "
      "FileError.");
  m.def(
      "read_solutions", [](const fs::path& path) { return read_solutions(path.string()); },
      "path"_a, nb::sig(signature("read_solutions", "", "list[Solution]").c_str()),
      nb::call_guard<Unlocked>(),
      "All known solutions of the problem of a file, if several are stored. "
      "Raises FileError.");
  m.def(
      "write_solutions",
      [](const fs::path& path, const nb::object& given, int compression) {
        const std::vector<Solution> solutions = solutions_from(given, "solutions");
        const Unlocked unlocked;
        const Problem problem = read_owner(path.string());
        std::vector<Solution> whole;
        Vector errors(static_cast<Eigen::Index>(solutions.size()));
        std::visit(
            [&](const auto& p) {
              for (const Solution& one : solutions) {
                whole.push_back(fclib::complete(p, one));
                errors[static_cast<Eigen::Index>(whole.size()) - 1] = merit(p, one).error;
              }
            },
            problem);
        write_solutions(path.string(), whole, errors,
                        {.replace = true, .compression = compression});
      },
      "path"_a, "solutions"_a, nb::kw_only(), "compression"_a = WriteOptions{}.compression,
      nb::sig(signature("write_solutions",
                        ", solutions: " + solutions_type + ", *, " + compression_type, "None")
                  .c_str()),
      "Puts all known solutions of a problem into its file, atomically.\n\n"
      "They replace those that write_solutions put there before; an empty list removes these. "
      "Merit.error of each is stored as /solutions/error. write_solution does not change them.\n\n"
      "Raises FileError, or ProblemError if the sizes disagree.");
  m.def(
      "kinds", [](const fs::path& path) { return read_contents(path.string()).kinds; }, "path"_a,
      nb::sig(signature("kinds", "", "list[str]").c_str()), nb::call_guard<Unlocked>(),
      "The kinds of the problems of a file. Raises FileError.");
  m.def(
      "contents",
      [](const fs::path& path) {
        Contents contents = read_contents(path.string());
        if (contents.solution) contents.kinds.emplace_back("solution");
        if (contents.guesses > 0) contents.kinds.emplace_back("guesses");
        if (contents.solutions > 0) contents.kinds.emplace_back("solutions");
        return contents.kinds;
      },
      "path"_a, nb::sig(signature("contents", "", "list[str]").c_str()), nb::call_guard<Unlocked>(),
      "What a file holds: the kinds of its problems, \"solution\", \"guesses\", and \"solutions\"\n"
      "if several are known. Raises FileError.");
  m.def(
      "left_out", [](const fs::path& path) { return read_left_out(path.string()); }, "path"_a,
      nb::sig(signature("left_out", "", "list[str]").c_str()), nb::call_guard<Unlocked>(),
      "What a file has besides its problems that cannot be read, such as a title of another type,\n"
      "and why. read() leaves it out. Raises FileError or ProblemError if a problem cannot be\n"
      "read.");
  m.def(
      "write_solution",
      [](const fs::path& path, const nb::object& given, int compression) {
        const Solution solution = solution_from(given, "solution");
        const Unlocked unlocked;
        const Problem problem = read_owner(path.string());
        const Solution whole =
            std::visit([&](const auto& p) { return fclib::complete(p, solution); }, problem);
        write_solution(path.string(), whole, {.replace = true, .compression = compression});
      },
      "path"_a, "solution"_a, nb::kw_only(), "compression"_a = WriteOptions{}.compression,
      nb::sig(signature("write_solution",
                        ", solution: " + solution_type + ", *, " + compression_type, "None")
                  .c_str()),
      "Puts a solution into a file that has its problem, in place of the one it had, atomically. "
      "It is that of the global problem if the file holds several.\n\n"
      "Raises FileError, ProblemError if the sizes disagree, or OptionError for a compression "
      "outside 0..9.");
  m.def(
      "read_attributes",
      [](const fs::path& path, const std::string& group) {
        return read_attributes(path.string(), group);
      },
      "path"_a, "group"_a,
      nb::sig(signature("read_attributes", ", group: str", "dict[str, float | str]").c_str()),
      nb::call_guard<Unlocked>(),
      "What a file says of its solution, of its problem (\"info\"), or of a guess (\"guesses/1\"), "
      "beside the data: numbers and texts by their names. Raises FileError.");
  m.def(
      "write_attributes",
      [](const fs::path& path, const std::string& group, const Attributes& attributes) {
        write_attributes(path.string(), group, attributes);
      },
      "path"_a, "group"_a, "attributes"_a,
      nb::sig(signature("write_attributes",
                        ", group: str, attributes: collections.abc.Mapping[str, float | str]",
                        "None")
                  .c_str()),
      nb::call_guard<Unlocked>(),
      "Gives the solution of a file, its problem (\"info\") or a guess (\"guesses/1\") attributes, "
      "in place of those of the same names, atomically. They go if what they are of is "
      "replaced.\n\n"
      "Raises FileError if the file has no solution, or no such guess.");
  m.def(
      "write_guesses",
      [](const fs::path& path, const nb::object& given, const std::string& mode, int compression) {
        const std::vector<Solution> guesses = solutions_from(given, "guesses");
        const Unlocked unlocked;
        WriteOptions options = options_of(mode, {"replace", "add"}, compression);
        options.append = mode == "add";
        const Problem problem = read_owner(path.string());
        const std::vector<Solution> whole =
            std::visit([&](const auto& p) { return complete(p, guesses); }, problem);
        write_guesses(path.string(), whole, options);
      },
      "path"_a, "guesses"_a, nb::kw_only(), "mode"_a = "replace",
      "compression"_a = WriteOptions{}.compression,
      nb::sig(signature("write_guesses",
                        ", " + guesses_type +
                            ", *, mode: typing.Literal['replace', 'add'] = "
                            "'replace', " +
                            compression_type,
                        "None")
                  .c_str()),
      "Puts guesses into a file that has their problem, atomically. mode says whether they "
      "replace those in the file (\"replace\") or follow them (\"add\").\n\n"
      "Raises FileError, ProblemError if the sizes disagree, or OptionError for an unknown mode "
      "or a compression outside 0..9.");
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    m.def(
        "write",
        [](const fs::path& path, const P& problem, const nb::object& given,
           const nb::object& given_guesses, const std::string& mode, int compression, bool dense,
           bool sync) {
          const bool solved = !given.is_none();
          const Solution solution = solved ? solution_from(given, "solution") : Solution{};
          const std::vector<Solution> guesses = solutions_from(given_guesses, "guesses");
          const Unlocked unlocked;
          WriteOptions options = options_of(mode, {"overwrite", "add", "replace"}, compression);
          options.dense = dense;
          options.sync = sync;
          if (!solved && guesses.empty()) {
            write_file(path.string(), &problem, nullptr, {}, options);
            return;
          }
          validate(problem);
          const Solution whole = solved ? fclib::complete(problem, solution) : Solution{};
          write_file(path.string(), &problem, solved ? &whole : nullptr, complete(problem, guesses),
                     options);
        },
        "path"_a, "problem"_a, "solution"_a.none() = nb::none(), "guesses"_a = nb::tuple(),
        nb::kw_only(), "mode"_a = "overwrite", "compression"_a = WriteOptions{}.compression,
        "dense"_a = false, "sync"_a = true,
        nb::sig(signature("write",
                          ", problem: " + class_name(P::kind) + ", solution: " + solution_type +
                              " | None = None, " + guesses_type +
                              " = (), *, mode: typing.Literal['overwrite', 'add', 'replace'] = "
                              "'overwrite', " +
                              compression_type + ", dense: bool = False, sync: bool = True",
                          "None")
                    .c_str()),
        "Writes an FCLIB file, atomically. If the solution or a guess has no v or no u, these are "
        "computed: readers of libfclib 3.1 need them.\n\n"
        "mode says what happens to a file that exists:\n\n"
        "- \"overwrite\": it is replaced whole;\n"
        "- \"add\": it keeps what it holds, and must not hold a problem of this kind;\n"
        "- \"replace\": its problem of this kind goes, with the solution and the guesses.\n\n"
        "In a file of several problems, solution and guesses belong to the global one. compression "
        "is the level of deflate, from 0 (none) to 9. Dense matrices are written by rows, which "
        "every reader can read; with dense=True those of a local problem keep their storage. With "
        "sync=False the file is not flushed to the disk: call sync_files after the last of many "
        "files.\n\n"
        "Raises FileError, ProblemError if the data is not valid, or OptionError for an unknown "
        "mode or a compression outside 0..9.");
  });
}

void bind_siconos(nb::module_& m) {
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    m.def(
        "write_siconos",
        [](const fs::path& path, const P& problem) { write_siconos(path.string(), &problem); },
        "path"_a, "problem"_a,
        nb::sig(signature("write_siconos", ", problem: " + class_name(P::kind), "None").c_str()),
        nb::call_guard<Unlocked>(),
        "Writes a problem in Siconos' text format (\".dat\"), atomically. A file of this name is "
        "replaced whole. Every number reads back equal. Matrices keep their storage, except those "
        "stored by rows: W is then written in blocks, and other matrices by columns. The format "
        "has no place for bilateral constraints, solutions and info.\n\n"
        "Raises UnsuitableError if there are bilateral constraints, FileError, or ProblemError "
        "if the data is not valid.");
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
      nb::sig(signature("read_siconos", ", kind: str | None = None", problem_union()).c_str()),
      "The problem in a text file of Siconos (\".dat\"), validated. What it holds is told from its "
      "sizes, or by `kind` (\"local\", \"global\", \"local_rolling\", "
      "\"global_rolling\", \"local_spin\", \"global_spin\").\n\n"
      "Raises FileError, naming file and line, ProblemError, or OptionError if there is no such "
      "kind.");
}

}  // namespace

std::vector<Solution> solutions_from(const nb::object& given, const std::string& what) {
  std::vector<Solution> result;
  for (const nb::handle one : given) {
    const std::string name = what + "[" + std::to_string(result.size()) + "]";
    result.push_back(solution_from(one, name.c_str()));
  }
  return result;
}

void bind_files(nb::module_& m) {
  bind_hdf5(m);
  bind_siconos(m);
}

}  // namespace fclib::bindings
