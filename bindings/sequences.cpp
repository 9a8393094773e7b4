#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <filesystem>
#include <string>
#include <vector>

#include "arrays.hpp"
#include "io/hdf5/sequence.hpp"
#include "module.hpp"
#include "problem.hpp"

namespace fclib::bindings {

using namespace nb::literals;

namespace {

namespace fs = std::filesystem;

/// Writes into a sequence. It holds the writer until it is closed.
class PythonWriter {
 public:
  PythonWriter(const fs::path& path, const std::string& mode, int compression)
      : path_(path.string()) {
    if (mode != "overwrite" && mode != "add") {
      throw Error(ErrorKind::option, "there is no mode '" + mode + "'; there are: overwrite, add",
                  "mode");
    }
    const Unlocked unlocked;
    writer_ = std::make_unique<SequenceWriter>(
        path_, SequenceOptions{.append = mode == "add", .compression = compression});
  }

  SequenceWriter& writer() {
    if (!writer_) throw Error(ErrorKind::file, "is closed", {}, path_);
    return *writer_;
  }

  void close() {
    const Unlocked unlocked;
    if (!writer_) return;
    const std::unique_ptr<SequenceWriter> last = std::move(writer_);
    last->close();
  }

  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
  std::unique_ptr<SequenceWriter> writer_;
};

template <class P>
void append(PythonWriter& self, const P& problem, const nb::object& given,
            const nb::object& given_guesses, Index world, const Attributes& attributes) {
  const bool solved = !given.is_none();
  const Solution solution = solved ? solution_from(given, "solution") : Solution{};
  const std::vector<Solution> guesses = solutions_from(given_guesses, "guesses");
  const Unlocked unlocked;
  validate(problem);
  if (solved) validate(solution, problem);
  for (std::size_t k = 0; k < guesses.size(); ++k) {
    validate(guesses[k], problem, guess_path(k + 1));
  }
  if (!solved && !attributes.empty()) {
    throw Error(ErrorKind::option, "are of a solution, and there is none", "attributes");
  }
  SequenceWriter& writer = self.writer();
  writer.add(view_of(&problem), world);
  if (solved) writer.add_solution(solution);
  if (!guesses.empty()) writer.add_guesses(guesses);
  if (!attributes.empty()) writer.add_attributes("solution", attributes);
  writer.end_step();
}

}  // namespace

void bind_sequences(nb::module_& m) {
  nb::class_<PythonWriter> cls(
      m, "SequenceWriter",
      "Writes a sequence: many problems, step by step, in one file.\n\n"
      ">>> with fclib.SequenceWriter(\"run.h5\") as steps:\n"
      "...     for problem in problems:\n"
      "...         steps.append(problem)\n\n"
      "mode says what happens to a file that exists: \"overwrite\" replaces it whole, \"add\" "
      "goes\n"
      "on with it. compression is the level of deflate of a new file, from 0 (none) to 9.\n\n"
      "A step is confirmed by flush(), or by the first append() a tenth of a second later, or\n"
      "after a MiB. What is confirmed stays if the process is killed at any moment. Others can\n"
      "read it meanwhile.\n\n"
      "Raises FileError if the file cannot be written, or another writer has it open.");
  cls.def(
      nb::init<const fs::path&, const std::string&, int>(), "path"_a, nb::kw_only(),
      "mode"_a = "overwrite", "compression"_a = 0,
      nb::sig("def __init__(self, path: str | os.PathLike[str], *, mode: "
              "typing.Literal['overwrite', 'add'] = 'overwrite', compression: int = 0) -> None"));
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    cls.def(
        "append", append<P>, "problem"_a, "solution"_a.none() = nb::none(),
        "guesses"_a = nb::tuple(), nb::kw_only(), "world"_a = 0, "attributes"_a = Attributes{},
        nb::sig(("def append(self, problem: " + class_name(P::kind) +
                 ", solution: " + solution_type + " | None = None, guesses: " + solutions_type +
                 " = (), *, world: int = 0, attributes: "
                 "collections.abc.Mapping[str, float | str] = {}) -> None")
                    .c_str()),
        "Adds a step: a problem, with its geometry, and a solution and guesses if there are.\n\n"
        "world is the number of the simulation if several are recorded together. An array that "
        "is equal to the one before it in its world is stored once. attributes are those of "
        "the solution.\n\n"
        "Raises ProblemError if the data is not valid, or FileError.");
  });
  cls.def(
      "flush",
      [](PythonWriter& self) {
        const Unlocked unlocked;
        self.writer().flush();
      },
      "Confirms all steps. Raises FileError.");
  cls.def("close", &PythonWriter::close,
          "Confirms all steps, and flushes the file to the disk. Raises FileError.");
  cls.def("__len__", [](PythonWriter& self) { return self.writer().size(); });
  cls.def(
      "__enter__", [](nb::handle self) { return nb::borrow(self); },
      nb::sig("def __enter__(self) -> SequenceWriter"));
  cls.def(
      "__exit__", [](PythonWriter& self, const nb::args&) { self.close(); },
      nb::sig("def __exit__(self, *error: object) -> None"));
  cls.def("__repr__",
          [](const PythonWriter& self) { return "<SequenceWriter " + self.path() + ">"; });
  m.def(
      "steps",
      [](const fs::path& path) -> nb::object {
        const auto found = [&] {
          const Unlocked unlocked;
          return read_steps(path.string());
        }();
        if (!found) return nb::none();
        nb::list list;
        for (const StepOf& step : *found) list.append(nb::make_tuple(step.world, step.number));
        return list;
      },
      "path"_a, nb::sig("def steps(path: str | os.PathLike[str]) -> list[tuple[int, int]] | None"),
      "The steps of a sequence: of each its world, and its number in that. None if the file is no "
      "sequence.\n\n"
      "Step k is a file to all functions that read: \"run.h5#17\". Raises FileError.");
  m.def(
      "step_path", [](const fs::path& path, std::size_t k) { return step_path(path.string(), k); },
      "path"_a, "k"_a, nb::sig("def step_path(path: str | os.PathLike[str], k: int) -> str"),
      "The path of step k of a sequence: \"run.h5#000017\".");
}

}  // namespace fclib::bindings
