#include "io/replace_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#ifdef __linux__
#include <sys/xattr.h>
#endif

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "error.hpp"

namespace fclib {

namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string& path, const std::string& message) {
  throw Error(ErrorKind::file, message, {}, path);
}
/// Throws with the reason that the system gives.
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

/// What the system knows of the file that is there. It must be writable.
std::optional<struct stat> status_of(const std::string& path, const std::string& target) {
  struct stat status{};
  if (::stat(target.c_str(), &status) != 0) return std::nullopt;
  if (S_ISDIR(status.st_mode)) fail(path, "is a directory, expected a file");
  if (!S_ISREG(status.st_mode)) fail(path, "is not a regular file");
  if (::access(target.c_str(), W_OK) != 0) fail_in_system(path, "cannot be written");
  return status;
}

/// Gives a new file the owner, the permissions and the extended attributes of the old one. Returns
/// false if one of these cannot be given.
bool take_over(int file, const std::string& target, const struct stat& old) {
  struct stat fresh{};
  if (::fstat(file, &fresh) != 0) return false;
  const bool same_owner = fresh.st_uid == old.st_uid && fresh.st_gid == old.st_gid;
  if (!same_owner && ::fchown(file, old.st_uid, old.st_gid) != 0) return false;
#ifdef __linux__
  const ssize_t size = ::listxattr(target.c_str(), nullptr, 0);
  if (size > 0) {
    std::string names(static_cast<std::size_t>(size), '\0');
    if (::listxattr(target.c_str(), names.data(), names.size()) != size) return false;
    for (std::size_t at = 0; at < names.size(); at += std::strlen(&names[at]) + 1) {
      const char* const name = &names[at];
      const ssize_t length = ::getxattr(target.c_str(), name, nullptr, 0);
      std::vector<char> value(static_cast<std::size_t>(std::max<ssize_t>(length, 0)));
      if (length < 0 || ::getxattr(target.c_str(), name, value.data(), value.size()) != length ||
          ::fsetxattr(file, name, value.data(), value.size(), 0) != 0) {
        return false;
      }
    }
  }
#endif
  return ::fchmod(file, old.st_mode & 07777U) == 0;
}

void write_all(int file, std::string_view bytes, const std::string& path) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(file, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) fail_in_system(path, "cannot be written");
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
}

using Pieces = std::span<const std::string_view>;

void write_all(int file, Pieces pieces, const std::string& path) {
  for (const std::string_view piece : pieces) write_all(file, piece, path);
}

std::string read_all(int file, std::size_t size, const std::string& path) {
  std::string bytes(size, '\0');
  std::size_t done = 0;
  while (done < size) {
    const ssize_t count = ::read(file, bytes.data() + done, size - done);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail_in_system(path, "cannot be read");
    if (count == 0) break;  // another program made it shorter
    done += static_cast<std::size_t>(count);
  }
  bytes.resize(done);
  return bytes;
}

/// A new file beside the target, which will be renamed over it. The system applies the umask of the
/// process: other threads may run, so it cannot be read here.
class Temporary {
 public:
  Temporary(const std::string& path, const std::string& target, mode_t mode)
      : path_(path), target_(target), file_(open(mode)) {}
  ~Temporary() {
    if (named_) ::unlink(name_.c_str());
  }
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;

  [[nodiscard]] bool ok() const { return file_.id() >= 0; }
  [[nodiscard]] int id() const { return file_.id(); }

  /// `fresh`: there was no target.
  void take_the_place(bool fresh) {
    if (!named_ && fresh && link_as(target_)) return;
    if (!named_) give_name();
    if (::rename(name_.c_str(), target_.c_str()) != 0) fail_in_system(path_, "cannot be written");
    named_ = false;
  }

 private:
  /// Without a name, if the system can do that: such a file disappears with its process.
  Descriptor open(mode_t mode) {
#ifdef O_TMPFILE
    const fs::path folder = fs::path(target_).parent_path();
    const int id =
        ::open(folder.empty() ? "." : folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, mode);
    if (id >= 0 && ::access(link_to(id).c_str(), F_OK) == 0) return Descriptor(id);
    if (id >= 0) ::close(id);
#endif
    int named = -1;
    take_a_name([&] {
      named = ::open(name_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, mode);
      return named >= 0;
    });
    return Descriptor(named);
  }

  void give_name() {
    take_a_name([&] { return link_as(name_); });
    if (!named_) fail_in_system(path_, "cannot be written");
  }

  /// A name that no file has, since take() replaces none.
  template <class Take>
  void take_a_name(const Take& take) {
    static std::atomic<unsigned> count{0};
    do {
      name_ = target_ + "." + std::to_string(::getpid()) + "-" + std::to_string(++count);
      named_ = take();
    } while (!named_ && errno == EEXIST);
  }

  [[nodiscard]] bool link_as(const std::string& name) const {
    const std::string own = link_to(id());
    return ::linkat(AT_FDCWD, own.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0;
  }

  static std::string link_to(int id) { return "/proc/self/fd/" + std::to_string(id); }

  const std::string& path_;
  const std::string& target_;
  std::string name_;
  bool named_ = false;
  Descriptor file_;
};

}  // namespace

FolderLock::FolderLock(const std::string& path) {
  const fs::path folder = fs::path(resolve_links(path)).parent_path();
  folder_ = ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  while (folder_ >= 0 && ::flock(folder_, LOCK_EX) != 0 && errno == EINTR) {
  }
}

FolderLock::~FolderLock() {
  if (folder_ >= 0) ::close(folder_);
}

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
  return read_all(file.id(), static_cast<std::size_t>(status.st_size), path);
}

std::string why_unreadable(const std::string& path) {
  return ::access(path.c_str(), R_OK) == 0 ? std::string() : std::strerror(errno);
}

bool is_locked(const std::string& path) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  return file.id() >= 0 && ::flock(file.id(), LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
}

std::string name_beside(const std::string& path) { return path + "." + std::to_string(::getpid()); }

WriterLock::WriterLock(std::string path)
    : path_(std::move(path)), file_(::open(path_.c_str(), O_RDWR | O_CLOEXEC)) {
  if (file_ < 0) fail_in_system();
#ifdef F_OFD_SETLK
  struct flock whole{};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  if (::fcntl(file_, F_OFD_SETLK, &whole) != 0 && (errno == EAGAIN || errno == EACCES)) {
    ::close(file_);
    fail(path_, "another writer has it open");
  }
#endif
}

WriterLock::~WriterLock() { ::close(file_); }

bool WriterLock::reserve(std::uint64_t end, std::uint64_t bytes) const {
#ifdef FALLOC_FL_KEEP_SIZE
  return ::fallocate(file_, FALLOC_FL_KEEP_SIZE, static_cast<off_t>(end),
                     static_cast<off_t>(bytes)) == 0 ||
         (errno != ENOSPC && errno != EDQUOT && errno != EFBIG);
#else
  static_cast<void>(end), static_cast<void>(bytes);
  return true;
#endif
}

void WriterLock::fail_in_system() const { fclib::fail_in_system(path_, "cannot be written"); }

void WriterLock::finish() const {
  struct stat status{};
  if (::fstat(file_, &status) != 0 || ::ftruncate(file_, status.st_size) != 0 ||
      ::fsync(file_) != 0) {
    fail_in_system();
  }
}

void replace_file(const std::string& path, std::string_view bytes) {
  replace_file(path, Pieces(&bytes, 1));
}

void replace_file(const std::string& path, Pieces pieces, bool sync) {
  const std::string target = resolve_links(path);
  const std::optional<struct stat> old = status_of(path, target);
  const mode_t own = S_IRUSR | S_IWUSR;
  const mode_t all = own | S_IRGRP | S_IWGRP | S_IROTH | S_IWOTH;
  Temporary file(path, target, old ? own : all);
  if (!file.ok()) fail_in_system(path, "cannot be written: no new file can be made beside it");
  if (old && !take_over(file.id(), target, *old)) {
    fail_in_system(path,
                   "cannot be replaced: a new file cannot be given its owner, permissions and "
                   "attributes. Write to another path");
  }
  write_all(file.id(), pieces, path);
  // the old file is not given up for one that may be lost
  if ((sync || old) && ::fsync(file.id()) != 0) fail_in_system(path, "cannot be written");
  file.take_the_place(!old);
}

void sync_files(const std::string& folder) {
#ifdef __linux__
  const Descriptor file(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (file.id() < 0 || ::syncfs(file.id()) != 0) fail_in_system(folder, "cannot be flushed");
#else
  static_cast<void>(folder);
  ::sync();
#endif
}

}  // namespace fclib
