// What a file says about its problem in words.
#pragma once

#include <string>
#include <tuple>

#include "field.hpp"

namespace fclib {

struct ProblemInfo {
  std::string title;
  std::string description;
  std::string math_info;

  static constexpr auto fields() {
    using S = ProblemInfo;
    return std::tuple{
        Field<S, std::string>{.name = "title", .member = &S::title, .doc = "title of the problem"},
        Field<S, std::string>{.name = "description",
                              .member = &S::description,
                              .doc = "short description: where the problem comes from"},
        Field<S, std::string>{.name = "math_info",
                              .member = &S::math_info,
                              .doc = "known properties: existence, uniqueness, ..."},
    };
  }

  bool operator==(const ProblemInfo&) const = default;
};

}  // namespace fclib
