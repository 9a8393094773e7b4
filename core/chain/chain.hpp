// Runs a table of stages: on the whole problem, then on each island of contacts that is left.
//
// Every stage returns to the best iterate so far, and most start from it; each island is held to
// its share of the tolerance. An iterate that is not finite ends the stage that made it, never the
// chain. If it does not solve the problem from a guess, it starts again from r = 0.
#pragma once

#include "chain/stages.hpp"
#include "solve/solver.hpp"

namespace fclib::chain {

/// From r; the best iterate ends in r. Where the factors of a system would not fit into memory the
/// methods that factorise are left out, and the message says so.
Outcome run(const ReducedProblem& problem, const Table& table, const Resources& resources,
            const Settings& settings, Vector& r);

}  // namespace fclib::chain
