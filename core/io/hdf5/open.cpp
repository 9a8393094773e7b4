#include "io/hdf5/open.hpp"

#include <charconv>
#include <filesystem>
#include <string_view>

namespace fclib::hdf5 {

std::optional<StepPath> as_step(const std::string& path) {
  const std::size_t mark = path.rfind('#');
  if (mark == path.npos || mark + 1 == path.size()) return std::nullopt;
  std::size_t step = 0;
  const char* const last = path.data() + path.size();
  const auto [end, error] = std::from_chars(path.data() + mark + 1, last, step);
  std::error_code unknown;
  const std::string file = path.substr(0, mark);
  if (error != std::errc() || end != last || std::filesystem::exists(path, unknown) ||
      !std::filesystem::exists(file, unknown)) {
    return std::nullopt;
  }
  return StepPath{file, step};
}

std::unique_ptr<StepFile> step_of(const Group& root, std::size_t step) {
  if (!root.has(sequence_group)) {
    fail("/", "is no sequence, which would have steps: leave out '#" + std::to_string(step) + "'");
  }
  const StoredSequence sequence(root);
  if (step >= sequence.size()) {
    const std::string steps = sequence.size() == 1 ? " step" : " steps";
    fail(root.child(sequence_group),
         "has " + std::to_string(sequence.size()) + steps + "; the first is number 0");
  }
  return sequence.step(step);
}

}  // namespace fclib::hdf5
