// An HDF5 file in memory, in pieces. Some of the pieces are memory of others.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/hdf5/handles.hpp"

namespace fclib::hdf5 {

/// The bytes of a file that is being made. Bytes that were lent are referred to, not copied.
class Pieces {
 public:
  Pieces() = default;
  /// Starts from these bytes.
  explicit Pieces(std::string bytes);
  Pieces(const Pieces&) = delete;
  Pieces& operator=(const Pieces&) = delete;

  /// Lends memory that stays as it is until the pieces are used. What is written from it is not
  /// copied.
  void lend(const void* data, std::size_t size);

  void write(std::uint64_t at, const char* data, std::size_t size);
  void read(std::uint64_t at, char* data, std::size_t size) const;

  /// The end of what was written.
  [[nodiscard]] std::uint64_t end() const { return end_; }
  /// The first `size` bytes; those that were never written are zero.
  [[nodiscard]] std::vector<std::string_view> all(std::uint64_t size) const;

 private:
  struct Loan {
    std::uint64_t end;
    const char* data;
  };

  [[nodiscard]] bool is_lent(const char* data, std::size_t size) const;
  void end_loans(std::uint64_t begin, std::uint64_t end);
  [[nodiscard]] const char* page(std::uint64_t number) const;

  std::string first_;
  std::vector<std::pair<const char*, const char*>> lent_;
  std::map<std::uint64_t, Loan> loans_;  // parts of the file that are memory of others, by begin
  std::map<std::uint64_t, std::unique_ptr<char[]>> pages_;  // ... that are not; loans lie over them
  std::uint64_t end_ = 0;
};

/// An open HDF5 file that lies in memory. HDF5 itself never writes to a disk: after an error of the
/// disk (when it is full) HDF5 is no longer in good order.
class MemoryFile {
 public:
  /// An empty file.
  MemoryFile();
  /// The file that these bytes are.
  explicit MemoryFile(std::string bytes);

  [[nodiscard]] hid_t id() const { return file_->id(); }

  /// See Pieces::lend().
  void lend(const void* data, std::size_t size) { contents_->pieces.lend(data, size); }

  /// Closes the file and returns its bytes. They are valid as long as this object and what was
  /// lent.
  [[nodiscard]] std::vector<std::string_view> finish();

  /// What the driver of HDF5 for this file works on.
  struct Contents {
    Pieces pieces;
    std::uint64_t size = 0;  // of the file, as HDF5 knows it
  };

 private:
  Handle access() const;

  std::unique_ptr<Contents> contents_;  // outlives the file
  Handle driver_;
  std::optional<Handle> file_;
};

}  // namespace fclib::hdf5
