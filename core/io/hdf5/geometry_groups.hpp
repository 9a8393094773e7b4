// The groups /contacts and /bodies of a file.
#pragma once

#include "geometry.hpp"
#include "io/hdf5/write_objects.hpp"

namespace fclib::hdf5 {

/// The attribute that marks our groups: other programs may use such names too.
inline constexpr const char* geometry_mark = "layout";
inline constexpr const char* geometry_layout = "FCLIB geometry 1";

/// The geometry of a file, or null if it has none. A group of such a name is ours only if it says
/// so; others are ignored.
GeometryPointer read_geometry(const Group& root);

/// Removes the geometry from a file.
void remove_geometry(const Group& root);

/// Writes a geometry into a file that has none.
void write_geometry(const Target& root, const Geometry& geometry);

}  // namespace fclib::hdf5
