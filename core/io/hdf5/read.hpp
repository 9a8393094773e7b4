// Reads FCLIB files. hdf5.hpp has their layout.
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
  Index guesses = 0;    ///< how many
  Index solutions = 0;  ///< known solutions, besides the one in /solution
};

Contents read_contents(const std::string& path);

/// What a file has besides its problems that cannot be read, such as a title of another type, and
/// why. The reads below leave it out. Throws if a problem cannot be read.
std::vector<std::string> read_left_out(const std::string& path);

/// The problem in the file, validated. If something that is not essential cannot be read, it is
/// left out. `kind` chooses if there are several problems.
Problem read_problem(const std::string& path, std::string_view kind = {});

/// The problem that the solution and the guesses of the file belong to, but only its sizes:
/// matrices have no entries, mu is zero. If there are several problems it is the global one, as in
/// libfclib 3.1.
Problem read_outline(const std::string& path);

/// The stored solution, or nothing if the file has none. Its sizes are not checked against a
/// problem; merit() and solve() do that. If there is a solution and `outline` is not null, it
/// becomes the outline of its problem, as read_outline() would give it, from the same state of the
/// file: another program may replace the file meanwhile.
std::optional<Solution> read_solution(const std::string& path, Problem* outline = nullptr);

/// The stored guesses, read like read_solution.
std::vector<Solution> read_guesses(const std::string& path, Problem* outline = nullptr);

/// All known solutions of the problem, if the file has several.
std::vector<Solution> read_solutions(const std::string& path);

}  // namespace fclib
