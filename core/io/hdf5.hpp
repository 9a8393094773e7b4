// FCLIB files: HDF5 in the layout of libfclib 3.1, for every formulation in problems/.
//
//   /fclib_local/{spacedim, W/, V/, R/, vectors/{q,mu,s}, info/{title,description,math_info}}
//   /fclib_global/{spacedim, M/, H/, G/, vectors/{f,w,mu,b}, info/}
//   /solution/{v,u,r,l}
//   matrix group: nzmax, m, n, nz, p, i, x; nz >= 0 triplet, -1 CSC, -2 CSR, -3 dense
//
// Every function throws Error (file) that names the file and the dataset. Writes are atomic: the
// new file is made beside the old one and renamed over it. HDF5 is not thread-safe; a lock of the
// library's own makes these functions so.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "problem.hpp"

namespace fclib {

/// What a file holds.
struct Contents {
  std::vector<std::string> kinds;  ///< "local", "global", ...
  bool solution = false;
};

Contents read_contents(const std::string& path);

/// The problem in the file, validated. `kind` chooses where there are several.
Problem read_problem(const std::string& path, std::string_view kind = {});

/// The stored solution, or nothing where the file has none. Its sizes are not checked against a
/// problem: merit() and solve() do.
std::optional<Solution> read_solution(const std::string& path);

/// Writes a new file, or replaces the old one whole. A solution must be complete (v for a global
/// problem, u): the readers of libfclib 3.1 end their host's process where it is not.
void write_file(const std::string& path, ProblemPointer problem,
                const Solution* solution = nullptr);

/// Puts a solution into a file that has its problem, in place of the one it had.
void write_solution(const std::string& path, const Solution& solution);

}  // namespace fclib
