// The tables of contacts and bodies from a caller's arrays.
#pragma once

#include "capi/structs.hpp"
#include "geometry.hpp"

namespace fclib::c {

/// Checks the arrays and copies them.
Geometry geometry_of_c(const fclib_geometry& geometry);

}  // namespace fclib::c
