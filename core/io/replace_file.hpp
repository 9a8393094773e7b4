// Whole files at once: a writer never leaves half a file behind.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace fclib {

/// Where a path leads to, through links; the last one may point to a file that is not there yet.
std::string resolve_links(const std::string& path);

/// All bytes of a regular file. Throws Error (file) that names it.
std::string read_file(const std::string& path);

/// Puts the bytes in the place of the file, all or none: they go into a file beside it, which is
/// flushed and renamed over it. A process that is killed leaves nothing of that file, but for the
/// instant between its naming and its renaming; where the system has no files without a name, it
/// leaves NAME.PID-1. Links are followed; owner, permissions and extended attributes kept.
///
/// Of a file with several names (hard links) this one gets the new file, and the others keep the
/// old one. Throws Error (file) that names the file, if its folder takes no new file or a new file
/// cannot be given its owner, permissions and attributes.
void replace_file(const std::string& path, std::string_view bytes);

/// The same of bytes that lie in pieces, one after another. Without `sync` a new file is not
/// flushed: a crash of the machine may lose it, until sync_files() was called.
void replace_file(const std::string& path, std::span<const std::string_view> pieces,
                  bool sync = true);

/// Flushes all files on the file system of this folder.
void sync_files(const std::string& folder);

/// Makes those who read a file, change it and put it back take turns. The lock is on the folder,
/// since the file itself is replaced; it goes with the process that holds it. If the file system
/// has no such locks, there is none.
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
