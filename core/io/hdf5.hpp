// FCLIB files: HDF5 in the layout of libfclib 3.1, for every formulation in problems/.
//
//   /fclib_local/{spacedim, W/, V/, R/, vectors/{q,mu,s}, info/{title,description,math_info}}
//   /fclib_global/{spacedim, M/, H/, G/, vectors/{f,w,mu,b}, info/}
//   /fclib_local_rolling, /fclib_global_rolling: the same, and vectors/mu_r
//   /solution/{v,u,r,l}
//   /guesses/{number_of_guesses, 1/{v,u,r,l}, 2/, ...}
//   matrix group: nzmax, m, n, nz, p, i, x; nz >= 0 triplet, -1 CSC, -2 CSR, -3 dense
//
// Every function throws Error (file) that names the file and the dataset. Writes are atomic: the
// new file is made beside the old one and renamed over it; writers that add to one file take turns.
// HDF5 is not thread-safe; a lock of the library's own makes these functions so.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "problem.hpp"

namespace fclib {

/// The version of HDF5 that this was compiled with.
std::string hdf5_compiled_version();
/// The version of HDF5 that is loaded. Where it is another one, files are neither read nor written:
/// Error (file), unless the environment has HDF5_DISABLE_VERSION_CHECK.
std::string hdf5_loaded_version();

/// What a file holds.
struct Contents {
  std::vector<std::string> kinds;  ///< "local", "global", ...
  bool solution = false;
  Index guesses = 0;  ///< how many
};

/// How a file is written.
struct WriteOptions {
  bool validate = true;  ///< false: the data goes in as it is, nothing checked, no matrix converted
  bool append = false;   ///< keep what the file holds: the other problems, the other guesses
  bool replace = false;  ///< what is there already gives way; false: it is an error
  int compression = 6;   ///< level of deflate, 0 (none) to 9
};

/// The value of a text that a file does not have, where it is read raw; writing it without
/// validation leaves it out. No text of a file can hold a NUL.
inline const std::string absent_text(1, '\0');

/// Numbers in memory from malloc, which C code takes over as it is.
template <class Number>
class MallocArray {
 public:
  MallocArray() = default;
  /// Not set to zero. There is memory even for no number.
  explicit MallocArray(std::size_t size)
      : data_(static_cast<Number*>(std::malloc(std::max<std::size_t>(size, 1) * sizeof(Number)))),
        size_(size) {
    if (data_ == nullptr) throw std::bad_alloc();
  }
  [[nodiscard]] Number* data() { return data_.get(); }
  [[nodiscard]] std::size_t size() const { return size_; }
  Number& operator[](std::size_t k) { return data_.get()[k]; }
  /// Forgets what is beyond `size`, which is no more than there is.
  void shorten(std::size_t size) { size_ = size; }
  /// The memory is the caller's, to be freed.
  Number* release() { return data_.release(); }

 private:
  struct Free {
    void operator()(Number* data) const { std::free(data); }
  };
  std::unique_ptr<Number[], Free> data_;
  std::size_t size_ = 0;
};

/// A matrix as a file has it: as Matrix, but i and x may go on after the last entry, since nzmax
/// leaves room there.
struct RawMatrix {
  Storage storage = Storage::csr;
  Index rows = 0;
  Index cols = 0;
  MallocArray<Index> p;
  MallocArray<Index> i;
  MallocArray<double> x;
  std::optional<MatrixInfo> info;
};

/// A problem as a file has it: its arrays have the lengths that the matrices declare, nothing else
/// is checked.
struct RawProblem {
  struct Member {
    std::string_view name;  ///< of the field
    std::variant<Index, RawMatrix, MallocArray<double>> value;
  };
  std::vector<Member> members;  ///< those that the file has
  ProblemInfo info;             ///< of texts that may be absent_text
};

Contents read_contents(const std::string& path);

/// The problem in the file, validated. `kind` chooses where there are several.
Problem read_problem(const std::string& path, std::string_view kind = {});

/// The problem of this kind, without validation, and without a copy of its arrays.
RawProblem read_raw_problem(const std::string& path, std::string_view kind);

/// The problem that the solution and the guesses of the file belong to, its sizes alone: matrices
/// have no entries, mu is zero. It is the global one where there are several, as in libfclib 3.1.
Problem read_outline(const std::string& path);

/// How many contacts the matrices say that there are. Throws Error (problem) where the sizes do not
/// divide.
template <class P>
Index contact_count(const P& problem) {
  const std::string group = "/" + group_name<P>() + "/";
  if (problem.spacedim < 1) {
    throw Error(ErrorKind::problem, "is " + std::to_string(problem.spacedim), group + "spacedim");
  }
  std::optional<Index> count;
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    if constexpr (std::is_same_v<Member, Matrix>) {
      if (count || field.cols != Dim::m) return;
      const Index m = (problem.*field.member).cols;
      if (m < 0 || m % problem.spacedim != 0) {
        throw Error(ErrorKind::problem,
                    "has " + std::to_string(m) + " columns, which is no multiple of spacedim = " +
                        std::to_string(problem.spacedim),
                    group + std::string(field.name));
      }
      count = m / problem.spacedim;
    }
  });
  return count.value_or(0);
}

/// Makes mu as long as there are contacts, zero; mu gives all other vectors their size.
template <class P>
void count_contacts(P& problem) {
  problem.mu = Vector::Zero(contact_count(problem));
}

/// The stored solution, or nothing where the file has none. Its sizes are not checked against a
/// problem: merit() and solve() do.
std::optional<Solution> read_solution(const std::string& path);

/// The stored guesses, as read_solution.
std::vector<Solution> read_guesses(const std::string& path);

/// Writes a new file, or replaces the old one whole; or adds to it (WriteOptions::append), where a
/// problem that replaces one of its kind takes its solution and its guesses with it. With
/// validation, no solution and no guess comes to belong to another problem. They must be complete
/// (v for a global problem, u): the readers of libfclib 3.1 end their host's process where they are
/// not.
void write_file(const std::string& path, ProblemPointer problem, const Solution* solution = nullptr,
                const std::vector<Solution>& guesses = {}, const WriteOptions& options = {});

/// Puts a solution into a file that has its problem, by default in place of the one it had.
void write_solution(const std::string& path, const Solution& solution,
                    const WriteOptions& options = {.replace = true});

/// Puts guesses into a file that has their problem, by default in place of those it had; or after
/// those (WriteOptions::append).
void write_guesses(const std::string& path, const std::vector<Solution>& guesses,
                   const WriteOptions& options = {.replace = true});

/// What is said of a solution or of a problem beside their data: numbers and texts by their names.
using Attributes = std::map<std::string, std::variant<double, std::string>>;

/// The attributes of a group that are one number or one text; others are left out, and there are
/// none where the file has no such group. The group is "solution", or "info" of the problem that a
/// solution belongs to.
Attributes read_attributes(const std::string& path, std::string_view group);

/// Gives a group attributes, in place of those of the same names. They go with what they are of: a
/// solution, or a problem, that replaces another has none. Throws Error (file) where the file has
/// no solution.
void write_attributes(const std::string& path, std::string_view group,
                      const Attributes& attributes);

/// Gives the info group of the problem that read_outline() finds, the local one first, an integer
/// attribute.
void write_int_attribute(const std::string& path, const std::string& name, Index value,
                         const WriteOptions& options = {.replace = true});

}  // namespace fclib
