// The memory that a process may still take.
#pragma once

namespace fclib {

/// [bytes] What the machine says is available, or what is left of the limit of the control group
/// (clusters and containers set one) if that is less. It is infinite if neither is known.
double available_memory();

}  // namespace fclib
