// A change of a whole file: all of it comes to the disk, or none.
#pragma once

#include <functional>
#include <string>

#include "io/hdf5/write_objects.hpp"

namespace fclib::hdf5 {

/// What a change starts from.
enum class Start { existing, empty, existing_or_empty };

/// Changes a file: change(root) writes into a copy, which then takes the place of the file. Changes
/// of one file take turns. `compression` is the level of deflate; see replace_file() for `sync`.
/// Where all_goes(root) holds of what is there, the copy is an empty file: HDF5 would leave a hole
/// for what is deleted.
void change_file(const std::string& path, Start start, int compression,
                 const std::function<void(const Target& root)>& change,
                 const std::function<bool(const Group& root)>& all_goes = {}, bool sync = true);

}  // namespace fclib::hdf5
