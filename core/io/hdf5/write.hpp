// Writes FCLIB files. hdf5.hpp has their layout.
#pragma once

#include <string>
#include <vector>

#include "geometry.hpp"
#include "io/hdf5/raw.hpp"
#include "problem.hpp"

namespace fclib {

/// How a file is written.
struct WriteOptions {
  bool validate = true;  ///< false: the data is written as it is, unchecked and unconverted
  bool append = false;   ///< keep what the file holds: the other problems, the other guesses
  bool replace = false;  ///< replace what is there already; false: it is an error
  bool dense = false;    ///< false: a dense matrix goes in by rows, since 3.1 reads no dense ones;
                         ///< without validation all stays as it is
  int compression = 6;   ///< level of deflate, 0 (none) to 9
  bool sync = true;      ///< false: a new file is left to the next sync_files()
};

/// Writes a new file, or replaces the whole old one, or adds to it (WriteOptions::append). With
/// `append`, a problem that replaces one of its kind removes the solution and the guesses of that
/// one. With validation, no solution and no guess can come to belong to another problem. Solutions
/// and guesses must be complete (v for a global problem, u): if they are not, the readers of
/// libfclib 3.1 end their host's process.
void write_file(const std::string& path, ProblemPointer problem, const Solution* solution = nullptr,
                const std::vector<Solution>& guesses = {}, const WriteOptions& options = {});

/// The same for a problem as it is, without validation: nothing is checked.
void write_file(const std::string& path, const ProblemView& problem, const WriteOptions& options);

/// A problem of the core as it is written without validation. It refers to the arrays of the
/// problem.
ProblemView view_of(ProblemPointer problem);

/// Writes a solution into a file that has its problem, by default in place of the old solution.
void write_solution(const std::string& path, const Solution& solution,
                    const WriteOptions& options = {.replace = true});

/// Writes guesses into a file that has their problem, by default in place of the old ones. With
/// WriteOptions::append they follow the old ones.
void write_guesses(const std::string& path, const std::vector<Solution>& guesses,
                   const WriteOptions& options = {.replace = true});

/// Writes a geometry into a file that has a problem with the same number of contacts.
void write_geometry(const std::string& path, const Geometry& geometry, const WriteOptions& options);

/// Writes all known solutions of a problem into its file, in place of the old ones, with the error
/// of each. They stay if /solution is replaced. They are removed with the problem.
void write_solutions(const std::string& path, const std::vector<Solution>& solutions,
                     const Vector& errors, const WriteOptions& options = {.replace = true});

}  // namespace fclib
