#include "io/replace_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <utility>

#include "error.hpp"

namespace fclib {

namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string& path, const std::string& message) {
  throw Error(ErrorKind::file, message, {}, path);
}
/// With what the system says of it.
[[noreturn]] void fail_in_system(const std::string& path, const char* message) {
  fail(path, std::string(message) + ": " + std::strerror(errno));
}

/// A file descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int id) : id_(id) {}
  Descriptor(Descriptor&& other) noexcept : id_(std::exchange(other.id_, -1)) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  Descriptor& operator=(Descriptor&&) = delete;
  ~Descriptor() {
    if (id_ >= 0) ::close(id_);
  }
  [[nodiscard]] int id() const { return id_; }

 private:
  int id_;
};

/// The permissions of the old file, or those a new one gets.
mode_t mode_of(const std::string& path, const std::string& target) {
  struct stat status{};
  if (::stat(target.c_str(), &status) == 0) {
    if (S_ISDIR(status.st_mode)) fail(path, "is a directory, expected a file");
    if (!S_ISREG(status.st_mode)) fail(path, "is not a regular file");
    if (::access(target.c_str(), W_OK) != 0) fail_in_system(path, "cannot be written");
    return status.st_mode & 07777U;
  }
  const mode_t mask = ::umask(0);
  ::umask(mask);
  return 0666U & ~mask;
}

/// A new file beside the target, to be renamed over it.
class Temporary {
 public:
  Temporary(const std::string& path, const std::string& target)
      : path_(path), target_(target), name_(target + ".XXXXXX"), file_(open()) {
    if (file_.id() < 0) fail_in_system(path_, "cannot be written");
  }
  ~Temporary() {
    if (named_) ::unlink(name_.c_str());
  }
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;

  [[nodiscard]] int id() const { return file_.id(); }

  void take_the_place() {
    if (!named_) give_name();
    if (::rename(name_.c_str(), target_.c_str()) != 0) fail_in_system(path_, "cannot be written");
    named_ = false;
  }

 private:
  /// Without a name, if that can be: such a file goes with its process.
  Descriptor open() {
#ifdef O_TMPFILE
    const fs::path folder = fs::path(target_).parent_path();
    const int id = ::open(folder.empty() ? "." : folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC,
                          S_IRUSR | S_IWUSR);
    if (id >= 0 && ::access(link_to(id).c_str(), F_OK) == 0) return Descriptor(id);
    if (id >= 0) ::close(id);
#endif
    Descriptor file(::mkstemp(name_.data()));
    named_ = file.id() >= 0;
    return file;
  }

  /// A name that no file has, since a link replaces none.
  void give_name() {
    static std::atomic<unsigned> count{0};
    do {
      name_ = target_ + "." + std::to_string(::getpid()) + "-" + std::to_string(++count);
      named_ = ::linkat(AT_FDCWD, link_to(id()).c_str(), AT_FDCWD, name_.c_str(),
                        AT_SYMLINK_FOLLOW) == 0;
    } while (!named_ && errno == EEXIST);
    if (!named_) fail_in_system(path_, "cannot be written");
  }

  static std::string link_to(int id) { return "/proc/self/fd/" + std::to_string(id); }

  const std::string& path_;
  const std::string& target_;
  std::string name_;
  bool named_ = false;
  Descriptor file_;
};

}  // namespace

std::string resolve_links(const std::string& path) {
  constexpr int most_hops = 40;
  fs::path target(path);
  std::error_code error;
  for (int hops = 0; hops < most_hops && fs::is_symlink(target, error); ++hops) {
    target = target.parent_path() / fs::read_symlink(target, error);
  }
  return target.string();
}

std::string read_file(const std::string& path) {
  // a pipe that nobody writes to must not hold the reader
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  struct stat status{};
  if (file.id() < 0 || ::fstat(file.id(), &status) != 0) fail_in_system(path, "cannot be read");
  if (!S_ISREG(status.st_mode)) fail(path, "is not a regular file");
  std::string bytes(static_cast<std::size_t>(status.st_size), '\0');
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = ::read(file.id(), bytes.data() + done, bytes.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail_in_system(path, "cannot be read");
    if (count == 0) break;  // somebody made it shorter
    done += static_cast<std::size_t>(count);
  }
  bytes.resize(done);
  return bytes;
}

void replace_file(const std::string& path, std::string_view bytes) {
  const std::string target = resolve_links(path);
  const mode_t mode = mode_of(path, target);
  Temporary file(path, target);
  ::fchmod(file.id(), mode);
  while (!bytes.empty()) {
    const ssize_t count = ::write(file.id(), bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) fail_in_system(path, "cannot be written");
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
  if (::fsync(file.id()) != 0) fail_in_system(path, "cannot be written");
  file.take_the_place();
}

}  // namespace fclib
