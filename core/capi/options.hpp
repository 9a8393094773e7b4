// Settings by name, and what a caller may ask of them.
#pragma once

#include <map>
#include <string>

#include "capi/structs.hpp"
#include "io/hdf5/write.hpp"
#include "solve/options.hpp"

/// What a caller has set. Numbers are kept as texts too.
struct fclib_options {
  fclib::OptionValues values;
  std::map<std::string, fclib::Vector, std::less<>> arrays;
  fclib_progress progress = nullptr;
  void* context = nullptr;
};

namespace fclib::c {

/// How a write works: as the options say (or NULL), else as the process has set it. Throws Error if
/// an option is unknown to writes.
WriteOptions write_options(const fclib_options* options);

}  // namespace fclib::c
