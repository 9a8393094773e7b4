// Problems as files have them, without validation and without copies. The C interface uses them.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

#include "geometry.hpp"
#include "linalg/matrix.hpp"
#include "problem_info.hpp"

namespace fclib {

/// The value of a text that a file does not have, if it is read raw. A write without validation
/// leaves such a text out. No text of a file can hold a NUL.
inline const std::string absent_text(1, '\0');
/// The same if not even the group of the texts is there.
inline const std::string absent_group(2, '\0');
/// Whether a text is written.
inline bool is_there(const std::string& text) {
  return text != absent_text && text != absent_group;
}

/// The storages of a matrix as files and C structs number them in `nz`. A number from 0 on is the
/// number of triplets.
constexpr Index nz_csc = -1;
constexpr Index nz_csr = -2;
constexpr Index nz_dense = -3;

/// Numbers in memory from malloc. C code takes them over as they are.
template <class Number>
class MallocArray {
 public:
  MallocArray() = default;
  /// Not set to zero. There is memory even for zero numbers.
  explicit MallocArray(std::size_t size)
      : data_(static_cast<Number*>(std::malloc(std::max<std::size_t>(size, 1) * sizeof(Number)))),
        size_(size) {
    if (data_ == nullptr) throw std::bad_alloc();
  }
  [[nodiscard]] Number* data() { return data_.get(); }
  [[nodiscard]] std::size_t size() const { return size_; }
  Number& operator[](std::size_t k) { return data_.get()[k]; }
  /// Drops what is beyond `size`, which is at most the present size.
  void shorten(std::size_t size) { size_ = size; }
  /// Gives the memory to the caller, who frees it.
  Number* release() { return data_.release(); }

 private:
  struct Free {
    void operator()(Number* data) const { std::free(data); }
  };
  std::unique_ptr<Number[], Free> data_;
  std::size_t size_ = 0;
};

/// A matrix as a file has it. It is like Matrix, but i and x may be longer than the entries, since
/// nzmax leaves room there.
struct RawMatrix {
  Storage storage = Storage::csr;
  Index rows = 0;
  Index cols = 0;
  MallocArray<Index> p;
  MallocArray<Index> i;
  MallocArray<double> x;
  std::optional<MatrixInfo> info;
};

template <class Numbers>
auto malloc_copy(const Numbers& values) {
  using Number = std::remove_cvref_t<decltype(values[0])>;
  MallocArray<Number> copy(static_cast<std::size_t>(values.size()));
  std::copy(values.begin(), values.end(), copy.data());
  return copy;
}

/// A matrix of the core as a matrix of a file.
inline RawMatrix raw_copy(const Matrix& a) {
  RawMatrix raw{.storage = a.storage,
                .rows = a.rows,
                .cols = a.cols,
                .p = {},
                .i = {},
                .x = malloc_copy(a.x),
                .info = a.info};
  if (a.storage != Storage::dense) {
    raw.p = malloc_copy(a.p);
    raw.i = malloc_copy(a.i);
  }
  return raw;
}

/// A problem as a file has it. Its arrays have the lengths that the matrices declare; nothing else
/// is checked.
struct RawProblem {
  struct Member {
    std::string_view name;  ///< of the field
    std::variant<Index, RawMatrix, MallocArray<double>> value;
  };
  std::vector<Member> members;  ///< those that the file has
  ProblemInfo info;             ///< its texts may be absent_text, or all absent_group
};

/// A matrix in memory of others, as it will be written.
struct RawMatrixView {
  Storage storage = Storage::csr;
  Index rows = 0;
  Index cols = 0;
  std::span<const Index> p = {};
  std::span<const Index> i = {};
  std::span<const double> x = {};
  std::optional<MatrixInfo> info = {};

  /// The storage as files number it.
  [[nodiscard]] Index nz() const {
    if (storage == Storage::csc) return nz_csc;
    if (storage == Storage::csr) return nz_csr;
    if (storage == Storage::dense) return nz_dense;
    return static_cast<Index>(x.size());
  }

  /// Read from a file without it.
  [[nodiscard]] bool absent() const { return rows == 0 && cols == 0 && x.empty() && p.empty(); }
};

/// A problem in memory of others, as it will be written.
struct ProblemView {
  struct Member {
    std::string_view name;  ///< of the field
    std::variant<Index, RawMatrixView, std::span<const double>> value;
  };
  std::string kind;
  std::vector<Member> members;  ///< those that are written, in the order of the fields
  ProblemInfo info;             ///< its texts may be absent_text, or all absent_group
  GeometryPointer geometry;
};

/// The problem of this kind, without validation and without a copy of its arrays.
RawProblem read_raw_problem(const std::string& path, std::string_view kind);

}  // namespace fclib
