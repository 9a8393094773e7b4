// Errors of the library: what is wrong, where, and what to do.
#pragma once

#include <stdexcept>
#include <string>

namespace fclib {

/// What went wrong, so that callers can tell their own mistakes from a bad file.
enum class ErrorKind {
  file,        ///< a file cannot be read or written, or is not in the FCLIB layout
  problem,     ///< the data of a problem or of a solution is not valid
  option,      ///< an unknown solver or option, or a value out of its range
  unsuitable,  ///< the request cannot be met for this problem (say, M is not positive definite)
};

/// The one exception that the core throws.
///
/// `where` names the place inside the file or the problem ("/fclib_local/vectors/mu[3]"). `file` is
/// the path; it is empty if there is none. what() joins them: "file: where: message".
class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, std::string message, std::string where = {}, std::string file = {});

  /// The same error with the file in which it was found.
  [[nodiscard]] Error in_file(const std::string& path) const;

  ErrorKind kind;
  std::string message;
  std::string where;
  std::string file;
};

}  // namespace fclib
