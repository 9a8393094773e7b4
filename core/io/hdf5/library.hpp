// Which version of HDF5 this is.
#pragma once

#include <string>

namespace fclib {

/// The version of HDF5 at compile time.
std::string hdf5_compiled_version();
/// The version of HDF5 that is loaded. If it is another one, files are neither read nor written,
/// and the calls throw Error (file), unless the environment has HDF5_DISABLE_VERSION_CHECK.
std::string hdf5_loaded_version();

}  // namespace fclib
