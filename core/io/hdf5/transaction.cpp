#include "io/hdf5/transaction.hpp"

#include <filesystem>

#include "io/hdf5/memory_file.hpp"
#include "io/hdf5/open.hpp"
#include "io/hdf5/write.hpp"
#include "io/replace_file.hpp"
#include "version.hpp"

namespace fclib::hdf5 {

namespace {

namespace fs = std::filesystem;

MemoryFile copy_of(const std::string& path) {
  try {
    return MemoryFile(read_file(path));
  } catch (const Error&) {
    const Handle file = open_file(path);  // its errors are the most precise
    throw;
  }
}

}  // namespace

void require_level(int compression) {
  if (compression < 0 || compression > 9) {
    throw Error(ErrorKind::option, "is " + std::to_string(compression) + ", but must be 0 to 9",
                "the compression level");
  }
}

void change_file(const std::string& path, Start start, int compression,
                 const std::function<void(const Target& root)>& change,
                 const std::function<bool(const Group& root)>& all_goes, bool sync) {
  require_level(compression);
  const Session session;
  in_file(path, [&] {
    if (as_step(path)) fail("", "is a step of a sequence, which stays as it was recorded");
    const FolderLock lock(path);
    std::error_code error;
    bool existing =
        start == Start::existing || (start == Start::existing_or_empty && fs::exists(path, error));
    MemoryFile file = [&] {
      if (!existing) return MemoryFile();
      MemoryFile there = copy_of(path);
      if (!all_goes || !all_goes(Group{there.id(), "/"})) return there;
      existing = false;
      return MemoryFile();
    }();
    const Style style(compression,
                      [&](const void* data, std::size_t size) { file.lend(data, size); });
    const Target root{{file.id(), "/"}, &style};
    if (root.has(sequence_group)) fail("/", "is a sequence, which grows by whole steps only");
    if (!existing) {
      write_text_attribute(root, "format", format_version);
      write_text_attribute(root, "generator", "fclib " + std::string(version));
    }
    change(root);
    replace_file(path, file.finish(), sync);
  });
}

}  // namespace fclib::hdf5
