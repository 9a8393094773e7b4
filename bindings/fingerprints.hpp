// What the built-in solvers are made of, a digest of each; cmake/fingerprints.py.
#pragma once

#include <map>
#include <string>

namespace fclib::bindings {

const std::map<std::string, std::string>& fingerprints();

}  // namespace fclib::bindings
