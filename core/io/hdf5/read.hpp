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
  Index solutions = 0;  ///< known ones, beside the one in /solution
};

Contents read_contents(const std::string& path);

/// What a file has beside its problems that cannot be read, such as a title of another type, and
/// why. The reads below leave it out. Throws where a problem cannot be read.
std::vector<std::string> read_left_out(const std::string& path);

/// The problem in the file, validated. What it can do without is left out where it cannot be read.
/// `kind` chooses where there are several.
Problem read_problem(const std::string& path, std::string_view kind = {});

/// The problem that the solution and the guesses of the file belong to, its sizes alone: matrices
/// have no entries, mu is zero. It is the global one where there are several, as in libfclib 3.1.
Problem read_outline(const std::string& path);

/// The stored solution, or nothing where the file has none. Its sizes are not checked against a
/// problem: merit() and solve() do. Where there is one, `outline` (or null) becomes that of its
/// problem, as read_outline() has it, of the file as it was then: others may replace it.
std::optional<Solution> read_solution(const std::string& path, Problem* outline = nullptr);

/// The stored guesses, as read_solution.
std::vector<Solution> read_guesses(const std::string& path, Problem* outline = nullptr);

/// All solutions that are known of the problem, where it has several.
std::vector<Solution> read_solutions(const std::string& path);

}  // namespace fclib
