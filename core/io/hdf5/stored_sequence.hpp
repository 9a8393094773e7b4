// A sequence as it is stored: many problems in one file that grows. docs/format.md has the reasons.
//
//   /fclib_sequence/
//     names      lines "POOL PATH": where an array lies, and what it is, as in the file of one
//     problem numbers    doubles, one array after another integers   32-bit integers, likewise
//     texts      bytes, likewise
//     entries    (name, length, start): the arrays of each step, one step after another
//     steps      (end, world, number, checksum): where the entries of a step end. Written last
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "io/hdf5/memory_file.hpp"
#include "io/hdf5/read_objects.hpp"

namespace fclib::hdf5 {

inline constexpr const char* sequence_group = "fclib_sequence";

/// Where arrays of one type lie.
enum class Pool { numbers, integers, texts };
inline constexpr std::array<const char*, 3> pool_names{"numbers", "integers", "texts"};

/// One array of a step.
struct Entry {
  std::int32_t name;    ///< number of its line in `names`
  std::int32_t length;  ///< how many numbers, or bytes
  std::int64_t start;   ///< in its pool
};

/// One step.
struct StepRow {
  std::int64_t end;        ///< of its entries; they begin at the end of the step before
  std::int32_t world;      ///< which of several simulations that were recorded together
  std::int32_t number;     ///< among the steps of its world, from 0
  std::uint32_t checksum;  ///< see StepChecksum
};

/// CRC-32 of all that a step is: of each array in their order its line in `names`, and the CRC-32
/// of its numbers; then the step's world and number.
class StepChecksum {
 public:
  void add(std::string_view line, std::uint32_t of_array);
  [[nodiscard]] std::uint32_t of(std::int32_t world, std::int32_t number) const;

 private:
  std::uint32_t sum_ = 0;
};

/// Their types, packed as in memory: of the file, in little endian, or of this machine.
enum class Side { file, memory };
Handle type_of_entry(Side side);
Handle type_of_step(Side side);

/// What a line of `names` says.
struct ArrayName {
  Pool pool;
  std::string path;

  [[nodiscard]] std::string line() const;
};

/// The file of one step, in memory.
class StepFile {
 public:
  [[nodiscard]] Group root() const { return {file_.id(), "/"}; }

 private:
  friend class StoredSequence;
  std::list<std::variant<std::vector<double>, std::vector<std::int32_t>, std::string>> arrays_;
  MemoryFile file_;  // refers to the arrays
};

/// The sequence of an open file.
class StoredSequence {
 public:
  explicit StoredSequence(const Group& root);

  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(steps_.size); }
  [[nodiscard]] std::vector<StepRow> rows(std::size_t first, std::size_t count) const;
  [[nodiscard]] const std::vector<ArrayName>& names() const { return names_; }

  /// Makes the file that would have this step alone. Throws if it is not what was written.
  [[nodiscard]] std::unique_ptr<StepFile> step(std::size_t k) const;

 private:
  [[nodiscard]] std::vector<Entry> entries_of(std::size_t k) const;

  Handle group_;
  std::string path_;
  Rows steps_;
  Rows entries_;
  std::vector<ArrayName> names_;
  std::vector<Rows> pools_;
};

}  // namespace fclib::hdf5
