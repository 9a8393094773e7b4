// Opens what a path leads to: a file, or one step of a sequence, "run.h5#000017".
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "io/hdf5/stored_sequence.hpp"

namespace fclib::hdf5 {

/// The path of a step.
struct StepPath {
  std::string file;
  std::size_t step;
};

/// What the path of a step says, if there is no file of the whole name, and one before the '#'.
std::optional<StepPath> as_step(const std::string& path);

/// The file of a step of the sequence with this root.
std::unique_ptr<StepFile> step_of(const Group& root, std::size_t step);

/// What body(root) returns of the root group of a file, or of the file that a step would have.
template <class Body>
auto read_from(const std::string& path, const Body& body) {
  const Session session;
  return in_file(path, [&] {
    const std::optional<StepPath> step = as_step(path);
    const Handle file = open_file(step ? step->file : path);
    if (!step) return body(Group{file.id(), "/"});
    const std::unique_ptr<StepFile> made = step_of({file.id(), "/"}, step->step);
    return body(made->root());
  });
}

}  // namespace fclib::hdf5
