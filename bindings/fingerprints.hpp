// A digest of the source of each built-in solver; cmake/fingerprints.py makes it.
#pragma once

#include <map>
#include <string>

namespace fclib::bindings {

const std::map<std::string, std::string>& fingerprints();

}  // namespace fclib::bindings
