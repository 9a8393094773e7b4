// Settings by name, and what is asked of them.
#pragma once

#include <map>
#include <string>

#include "capi/structs.hpp"
#include "io/hdf5/write.hpp"
#include "solve/options.hpp"

/// What a caller has set: numbers are texts too.
struct fclib_options {
  fclib::OptionValues values;
  std::map<std::string, fclib::Vector, std::less<>> arrays;
  fclib_progress progress = nullptr;
  void* context = nullptr;
};

namespace fclib::c {

/// How a write goes: what the options say (or NULL), else what the process has set. Throws Error at
/// an option that no write has.
WriteOptions write_options(const fclib_options* options);

}  // namespace fclib::c
