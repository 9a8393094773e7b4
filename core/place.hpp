// The name of a place in a file or a problem, for errors.
#pragma once

#include <array>
#include <concepts>
#include <string>
#include <string_view>

namespace fclib {

/// What `Error::where` will say. It holds views of texts that outlive it. They are joined only if
/// there is an error, since most data is right.
class Place {
 public:
  template <std::convertible_to<std::string_view>... Text>
    requires(sizeof...(Text) >= 1 && sizeof...(Text) <= 4)
  Place(const Text&... parts)  // NOLINT(google-explicit-constructor): a text is a place
      : parts_{std::string_view(parts)...} {}

  /// A member of this place.
  [[nodiscard]] Place operator/(std::string_view name) const {
    Place place = *this;
    place.member_ = name;
    return place;
  }

  operator std::string() const {  // NOLINT(google-explicit-constructor): as an error takes it
    std::string text;
    for (const std::string_view part : parts_) text += part;
    if (!member_.empty()) text.append("/").append(member_);
    return text;
  }

 private:
  std::array<std::string_view, 4> parts_;
  std::string_view member_;
};

inline std::string operator+(const Place& place, std::string_view more) {
  return std::string(place).append(more);
}

}  // namespace fclib
