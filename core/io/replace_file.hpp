// Files as the system has them: reads and writes of whole files, and locks. A writer never leaves
// half a file behind. All of core/ that calls POSIX for files is here.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace fclib {

/// The file that a path leads to, through links. The last link may point to a file that does not
/// exist yet.
std::string resolve_links(const std::string& path);

/// All bytes of a regular file. Throws Error (file) that names it.
std::string read_file(const std::string& path);

/// Why this process may not read a file, in the words of the system. Empty if it may.
std::string why_unreadable(const std::string& path);

/// Whether another program has locked a file so that it alone may write to it.
bool is_locked(const std::string& path);

/// Puts the bytes in the place of the file, all or none: they go into a new file beside it, which
/// is flushed and renamed over it. If the process is killed, the new file disappears, except in the
/// instant between its naming and its renaming. If the system has no files without a name, a killed
/// process leaves NAME.PID-1. Links are followed. Owner, permissions and extended attributes are
/// kept.
///
/// If a file has several names (hard links), this name gets the new file, and the others keep the
/// old one. Throws Error (file) that names the file, if its folder takes no new file or a new file
/// cannot be given its owner, permissions and attributes.
void replace_file(const std::string& path, std::string_view bytes);

/// The same for bytes in several pieces, one after another. Without `sync` a new file is not
/// flushed: until sync_files() is called, a crash of the machine may lose it.
void replace_file(const std::string& path, std::span<const std::string_view> pieces,
                  bool sync = true);

/// The name of a new file beside this one, which no other process makes.
std::string name_beside(const std::string& path);

/// Makes sure that one program writes to a growing file at a time. The lock ends with the process.
/// HDF5 itself locks files in another way, which keeps readers out. Throws Error (file) that names
/// the file.
class WriterLock {
 public:
  explicit WriterLock(std::string path);
  ~WriterLock();
  WriterLock(const WriterLock&) = delete;
  WriterLock& operator=(const WriterLock&) = delete;

  /// Takes room behind the end of the file, and returns whether there is.
  [[nodiscard]] bool reserve(std::uint64_t end, std::uint64_t bytes) const;
  /// Throws with the reason that the system gave last.
  [[noreturn]] void fail_in_system() const;
  /// Gives back what room is left, and waits for the disk.
  void finish() const;

 private:
  std::string path_;
  int file_ = -1;
};

/// Flushes all files on the file system of this folder.
void sync_files(const std::string& folder);

/// Makes programs that read a file, change it and write it back take turns. The lock is on the
/// folder, since the file itself is replaced. It ends with the process that holds it. If the file
/// system has no such locks, there is none.
class FolderLock {
 public:
  explicit FolderLock(const std::string& path);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int folder_ = -1;
};

}  // namespace fclib
