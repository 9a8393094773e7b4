// Runs a table of stages, first on the whole problem, then on each island that is not solved yet.
//
// Every stage returns the best iterate so far, and most stages start from it. Each island must meet
// its share of the tolerance. If an iterate is not finite, the stage that made it ends, but not the
// chain. If the chain does not solve the problem from a guess, it starts again from r = 0.
#pragma once

#include "chain/stages.hpp"
#include "solve/solver.hpp"

namespace fclib::chain {

/// Starts from r, and leaves the best iterate in r. If the factors of a system do not fit into
/// memory, the methods that factorise are left out, and the message says so.
Outcome run(const ReducedProblem& problem, const Table& table, const Resources& resources,
            const Settings& settings, Vector& r);

}  // namespace fclib::chain
