// Reactions of bodies at rest: of the many that hold them, those nearest to others.
#pragma once

#include <optional>

#include "problems/global.hpp"
#include "solution.hpp"
#include "stepping/columns.hpp"

namespace fclib::stepping {

/// The part of a change of reactions (m) that moves bodies: the least x with H x = H change. What
/// is left moves nothing.
Vector moving_part(const Columns& H, ConstVectorRef change);

/// The reactions nearest to r (m) of bodies at rest, without the cones; nothing if bodies move, or
/// if their reactions are unique.
///
/// Reactions of sticking contacts may change by any dr that moves nothing, H dr = 0.
///
/// still   bodies are at rest below this speed at contacts, relative to the largest without
///         reactions
std::optional<Vector> nearest_at_rest(const GlobalProblem& problem, const Solution& solution,
                                      ConstVectorRef r, double still);

}  // namespace fclib::stepping
