// A change of a whole file: either all of it reaches the disk, or nothing.
#pragma once

#include <functional>
#include <string>

#include "io/hdf5/write_objects.hpp"

namespace fclib::hdf5 {

/// Throws Error (option) if deflate has no such level.
void require_level(int compression);

/// What a change starts from.
enum class Start { existing, empty, existing_or_empty };

/// Changes a file: change(root) writes into a copy, which then takes the place of the file. Changes
/// of one file take turns. `compression` is the level of deflate; see replace_file() for `sync`. If
/// all_goes(root) is true for the old file, the copy starts empty: HDF5 would leave a hole for what
/// is deleted.
void change_file(const std::string& path, Start start, int compression,
                 const std::function<void(const Target& root)>& change,
                 const std::function<bool(const Group& root)>& all_goes = {}, bool sync = true);

}  // namespace fclib::hdf5
