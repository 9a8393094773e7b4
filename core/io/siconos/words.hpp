// Words and numbers of a text, one after the other.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "number_text.hpp"

namespace fclib::siconos {

using Count = std::int64_t;

/// "W", "the first matrix": what is being read now, for messages.
using What = std::string_view;

/// A text and a position in it. Every error says in which line it was.
class Words {
 public:
  explicit Words(std::string_view text) : rest_(text) {}

  [[nodiscard]] Count line() const { return line_; }

  [[noreturn]] static void fail_at(Count line, const std::string& message);
  [[noreturn]] void fail(const std::string& message) const { fail_at(line_, message); }

  /// Whether only white space follows.
  bool at_end();

  std::string_view token(What what);

  /// The rest of the line. The position moves past its end.
  std::string_view rest_of_line();

  void literal(std::string_view expected, What what);

  std::int32_t integer(What what, Count lowest, Count highest) {
    return in_range(token(what), what, lowest, highest);
  }

  std::int32_t in_range(std::string_view text, What what, Count lowest, Count highest) const;

  double number(What what);

  /// Throws if the file is too short for what it announces, before memory is asked for. Each thing
  /// takes at least `bytes` characters. A small number is not checked: the error of the read itself
  /// says better what is missing.
  void require_room(Count count, Count bytes, What what) const;

  /// The words up to the end, separated by white space, at most `most` of them.
  [[nodiscard]] Count words_left(Count most) const;

 private:
  void count_line();
  void skip_space();

  std::string_view rest_;
  Count line_ = 1;
  bool ended_line_ = false;  // the line feed before rest_ is not counted yet
};

}  // namespace fclib::siconos
