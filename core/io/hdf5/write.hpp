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
  bool validate = true;  ///< false: the data goes in as it is, nothing checked, no matrix converted
  bool append = false;   ///< keep what the file holds: the other problems, the other guesses
  bool replace = false;  ///< what is there already gives way; false: it is an error
  bool dense = false;    ///< false: a dense matrix goes in by rows, since 3.1 reads no dense ones;
                         ///< without validation all stays as it is
  int compression = 6;   ///< level of deflate, 0 (none) to 9
  bool sync = true;      ///< false: a new file is left to the next sync_files()
};

/// Writes a new file, or replaces the old one whole; or adds to it (WriteOptions::append), where a
/// problem that replaces one of its kind takes its solution and its guesses with it. With
/// validation, no solution and no guess comes to belong to another problem. They must be complete
/// (v for a global problem, u): the readers of libfclib 3.1 end their host's process where they are
/// not.
void write_file(const std::string& path, ProblemPointer problem, const Solution* solution = nullptr,
                const std::vector<Solution>& guesses = {}, const WriteOptions& options = {});

/// The same of a problem as it is, nothing checked: without validation.
void write_file(const std::string& path, const ProblemView& problem, const WriteOptions& options);

/// Puts a solution into a file that has its problem, by default in place of the one it had.
void write_solution(const std::string& path, const Solution& solution,
                    const WriteOptions& options = {.replace = true});

/// Puts guesses into a file that has their problem, by default in place of those it had; or after
/// those (WriteOptions::append).
void write_guesses(const std::string& path, const std::vector<Solution>& guesses,
                   const WriteOptions& options = {.replace = true});

/// Puts a geometry into a file that has a problem of as many contacts.
void write_geometry(const std::string& path, const Geometry& geometry, const WriteOptions& options);

/// Puts all solutions that are known of a problem into its file, in place of those it had, with the
/// error of each. They stay where /solution is replaced, and go with the problem.
void write_solutions(const std::string& path, const std::vector<Solution>& solutions,
                     const Vector& errors, const WriteOptions& options = {.replace = true});

}  // namespace fclib
