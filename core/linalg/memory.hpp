// Memory that a process may still take.
#pragma once

namespace fclib {

/// [bytes] What the machine says is available, or what is left of the limit of the control group
/// (as clusters and containers set) where that is less; infinite where neither is known.
double available_memory();

}  // namespace fclib
