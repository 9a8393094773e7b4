// Whole files at once: a writer never leaves half a file behind.
#pragma once

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
/// leaves NAME.XXXXXX. Links are followed, permissions kept. Throws Error (file) that names the
/// file.
void replace_file(const std::string& path, std::string_view bytes);

}  // namespace fclib
