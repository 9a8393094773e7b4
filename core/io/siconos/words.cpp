#include "io/siconos/words.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "error.hpp"

namespace fclib::siconos {

namespace {

bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

}  // namespace

void Words::fail_at(Count line, const std::string& message) {
  throw Error(ErrorKind::file, message, "line " + std::to_string(line));
}

bool Words::at_end() {
  skip_space();
  return rest_.empty();
}

std::string_view Words::token(What what) {
  if (at_end()) fail("the file ends inside " + std::string(what));
  std::size_t size = 0;
  while (size < rest_.size() && !is_space(rest_[size])) ++size;
  const std::string_view result = rest_.substr(0, size);
  rest_.remove_prefix(size);
  return result;
}

std::string_view Words::rest_of_line() {
  count_line();
  const std::size_t size = std::min(rest_.find('\n'), rest_.size());
  const std::string_view result = rest_.substr(0, size);
  rest_.remove_prefix(std::min(size + 1, rest_.size()));
  ended_line_ = true;
  return result;
}

void Words::literal(std::string_view expected, What what) {
  const std::string_view found = token(what);
  if (found != expected) {
    fail(quoted(found) + " stands in " + std::string(what) + " where '" + std::string(expected) +
         "' is expected");
  }
}

std::int32_t Words::in_range(std::string_view text, What what, Count lowest, Count highest) const {
  Count value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = end == text.data() + text.size();
  if (!whole || error == std::errc::invalid_argument) {
    fail(quoted(text) + " is not an integer (" + std::string(what) + ")");
  }
  if (error != std::errc() || value < lowest || value > highest) {
    fail(std::string(what) + " is " + std::string(text.substr(0, 24)) + ", but must be in " +
         std::to_string(lowest) + ".." + std::to_string(highest));
  }
  return static_cast<std::int32_t>(value);
}

double Words::number(What what) {
  const std::string_view text = token(what);
  const std::string_view bare = text.substr(text.front() == '+' ? 1 : 0);
  double value = 0;
  const auto [end, error] = read_number(bare.data(), bare.data() + bare.size(), value);
  if (end != bare.data() + bare.size() || error == std::errc::invalid_argument) {
    fail(quoted(text) + " is not a number (" + std::string(what) + ")");
  }
  if (!std::isfinite(value)) {
    fail(quoted(text) + " is not a finite number (" + std::string(what) + ")");
  }
  return value;
}

void Words::require_room(Count count, Count bytes, What what) const {
  constexpr Count small = 4096;
  if (count > small && count > static_cast<Count>(rest_.size()) / bytes + 1) {
    fail(std::string(what) + " has " + std::to_string(count) +
         " entries by its sizes, but the file ends before");
  }
}

Count Words::words_left(Count most) const {
  Words ahead = *this;
  Count count = 0;
  for (; count < most && !ahead.at_end(); ++count) ahead.token("");
  return count;
}

void Words::count_line() {
  if (ended_line_) ++line_;
  ended_line_ = false;
}

void Words::skip_space() {
  count_line();
  std::size_t size = 0;
  for (; size < rest_.size() && is_space(rest_[size]); ++size) {
    if (rest_[size] == '\n') ++line_;
  }
  rest_.remove_prefix(size);
}

}  // namespace fclib::siconos
