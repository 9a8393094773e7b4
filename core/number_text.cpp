#include "number_text.hpp"

#include <locale.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <string_view>
#if __has_include(<xlocale.h>)
#include <xlocale.h>
#endif

namespace fclib {

std::string quoted(std::string_view text) {
  constexpr std::size_t longest = 40;  // as long as the name of a file or of a dataset
  std::string result = "'";
  for (const char c : text.substr(0, longest)) result += c >= ' ' && c <= '~' ? c : '?';
  return result + (text.size() > longest ? "...'" : "'");
}

namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// The end of the number that starts at `first`; `first` if no number starts there.
const char* end_of_number(const char* first, const char* last) {
  const auto digits = [&](const char* at) {
    while (at != last && is_digit(*at)) ++at;
    return at;
  };
  const char* at = first != last && *first == '-' ? first + 1 : first;
  for (const std::string_view word : {"infinity", "inf", "nan"}) {
    std::size_t size = 0;
    while (size < word.size() && at + size != last && (at[size] | 0x20) == word[size]) ++size;
    if (size == word.size()) return at + size;
  }
  const char* const whole = digits(at);
  const bool point = whole != last && *whole == '.';
  const char* end = point ? digits(whole + 1) : whole;
  if (end - at == (point ? 1 : 0)) return first;
  if (end != last && (*end | 0x20) == 'e') {
    const char* exponent = end + 1;
    if (exponent != last && (*exponent == '-' || *exponent == '+')) ++exponent;
    if (exponent != last && is_digit(*exponent)) end = digits(exponent);
  }
  return end;
}

/// The C locale for the calling thread, as long as this lives: strtod and printf use it.
class PlainLocale {
 public:
  PlainLocale() {
    static const locale_t plain = newlocale(LC_ALL_MASK, "C", nullptr);
    before_ = uselocale(plain);
  }
  ~PlainLocale() { uselocale(before_); }
  PlainLocale(const PlainLocale&) = delete;
  PlainLocale& operator=(const PlainLocale&) = delete;

 private:
  locale_t before_;
};

}  // namespace

namespace detail {

std::string shortest_by_trial(double value) {
  if (std::isnan(value)) return std::signbit(value) ? "-nan" : "nan";
  if (std::isinf(value)) return value < 0 ? "-inf" : "inf";
  const PlainLocale plain;
  char text[32];
  int digits = 1;
  for (;; ++digits) {
    std::snprintf(text, sizeof text, "%.*e", digits - 1, value);
    if (digits == std::numeric_limits<double>::max_digits10 || std::strtod(text, nullptr) == value)
      break;
  }
  // the shorter of the two ways to write it; if they are equal, the one without an exponent
  const std::string scientific = text;
  const int exponent = std::atoi(scientific.c_str() + scientific.find('e') + 1);
  if (exponent < -6 || exponent > 25) return scientific;
  char fixed[64];
  std::snprintf(fixed, sizeof fixed, "%.*f", std::max(0, digits - 1 - exponent), value);
  return std::string_view(fixed).size() <= scientific.size() ? fixed : scientific;
}

std::from_chars_result read_by_strtod(const char* first, const char* last, double& value) {
  const char* const end = end_of_number(first, last);
  if (end == first) return {first, std::errc::invalid_argument};
  const std::string text(first, end);
  const PlainLocale plain;
  value = std::strtod(text.c_str(), nullptr);
  const bool named = (end[-1] | 0x20) >= 'f';  // inf, infinity, nan
  if (std::isinf(value) && !named) return {end, std::errc::result_out_of_range};
  if (value == 0 && text.find_first_of("123456789") < text.find_first_of("eE")) {
    return {end, std::errc::result_out_of_range};
  }
  return {end, std::errc()};
}

}  // namespace detail

#ifdef __cpp_lib_to_chars

std::string shortest(double value) {
  char digits[32];
  return {digits, std::to_chars(std::begin(digits), std::end(digits), value).ptr};
}

std::from_chars_result read_number(const char* first, const char* last, double& value) {
  const std::from_chars_result result = std::from_chars(first, last, value);
  if (result.ec != std::errc::result_out_of_range) return result;
  // any reader rounds it to the double next to it
  const std::string_view text(first, result.ptr);
  long double wide = 0;
  if (std::from_chars(first, result.ptr, wide).ec == std::errc()) {
    value = static_cast<double>(wide);
  } else {
    const bool small = text.find("e-") != text.npos || text.find("E-") != text.npos;
    value = small ? 0.0 : std::numeric_limits<double>::infinity();
    if (text.front() == '-') value = -value;
  }
  return result;
}

#else

std::string shortest(double value) { return detail::shortest_by_trial(value); }

std::from_chars_result read_number(const char* first, const char* last, double& value) {
  return detail::read_by_strtod(first, last, value);
}

#endif

}  // namespace fclib
