// Sequences: many problems of one simulation, or of many worlds, in one file that grows.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/hdf5/attributes.hpp"
#include "io/hdf5/raw.hpp"
#include "problem.hpp"

namespace fclib {

/// Which step of which simulation a problem is.
struct StepOf {
  Index world;   ///< 0, if there is only one
  Index number;  ///< among the steps of its world that are in the file, from 0
};

/// The path of step k of a sequence, which all functions that read take: "run.h5#000017".
std::string step_path(const std::string& path, std::size_t k);

/// The steps of a sequence that are confirmed, or nothing if the file is no sequence.
std::optional<std::vector<StepOf>> read_steps(const std::string& path);

/// How a sequence is written.
struct SequenceOptions {
  bool append = false;  ///< go on with the file that is there; false: it is replaced whole
  int compression = 0;  ///< level of deflate of a new file, 0 (none) to 9
};

/// Writes a sequence step by step. A step is confirmed by flush(), or by the first step that ends a
/// tenth of a second later, or after a MiB. What is confirmed stays if the process is killed at any
/// moment, and others can read it meanwhile. Many threads may use one writer; what belongs to a
/// step comes from one of them.
class SequenceWriter {
 public:
  /// Throws Error (file) if another program writes to the file, (option) for another compression.
  explicit SequenceWriter(const std::string& path, const SequenceOptions& options = {});
  /// Closes the file. close() reports errors.
  ~SequenceWriter();
  SequenceWriter(const SequenceWriter&) = delete;
  SequenceWriter& operator=(const SequenceWriter&) = delete;

  /// Begins a step with its problem. An array that is equal to the last one of its name in its
  /// world is stored once. Only the world is checked: it is 0 or more.
  void add(const ProblemView& problem, Index world = 0);
  // ... and what else belongs to the step. The sizes are not checked
  void add_solution(const Solution& solution);
  void add_guesses(const std::vector<Solution>& guesses);
  void add_geometry(const Geometry& geometry);
  /// `group` is "solution", "guesses/1", ..., or "info".
  void add_attributes(const std::string& group, const Attributes& attributes);
  /// Ends a step. The next one does so, too.
  void end_step();

  /// How many steps there are, with the one that has begun.
  [[nodiscard]] std::size_t size() const;

  /// Ends the step and confirms all.
  void flush();
  /// The same, and the disk has it. No other function may be called afterwards.
  void close();

 private:
  class File;
  std::unique_ptr<File> file_;
  std::string info_;  // the path of the info of the step
};

}  // namespace fclib
