// The status of a solve as C has it.
#pragma once

#include "capi/structs.hpp"
#include "solve/solver.hpp"

namespace fclib::c {

inline fclib_status status_in_c(Status status) {
  switch (status) {
    case Status::converged:
      return FCLIB_CONVERGED;
    case Status::iteration_limit:
      return FCLIB_ITERATION_LIMIT;
    case Status::time_limit:
      return FCLIB_TIME_LIMIT;
    case Status::diverged:
      return FCLIB_DIVERGED;
    case Status::inaccurate:
      return FCLIB_INACCURATE;
    case Status::interrupted:
      return FCLIB_INTERRUPTED;
    case Status::stalled:
      return FCLIB_STALLED;
    case Status::infeasible:
      return FCLIB_INFEASIBLE;
    case Status::invalid:
      return FCLIB_INVALID;
  }
  return FCLIB_DIVERGED;
}

}  // namespace fclib::c
