// The words of a chain's table, as they are shown to a user.
#pragma once

#include <string>
#include <vector>

#include "solve/options.hpp"

namespace fclib::chain {

/// A method that a stage may name, with its rules.
struct MethodInfo {
  std::string name;
  std::string doc;
  std::vector<OptionInfo> rules;
};

/// All methods. The first entry has no name: it holds the keys that any stage may have.
std::vector<MethodInfo> describe_methods();

}  // namespace fclib::chain
