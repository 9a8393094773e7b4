// The groups /contacts and /bodies of a file.
#pragma once

#include "geometry.hpp"
#include "io/hdf5/write_objects.hpp"

namespace fclib::hdf5 {

/// The geometry of a file, null where it has none. Groups of these names that do not say that they
/// are ours are passed over.
GeometryPointer read_geometry(const Group& root);

/// Takes the geometry out of a file.
void remove_geometry(const Group& root);

/// Puts a geometry into a file that has none.
void write_geometry(const Target& root, const Geometry& geometry);

}  // namespace fclib::hdf5
