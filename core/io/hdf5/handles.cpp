#include "io/hdf5/handles.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "io/hdf5/library.hpp"
#include "number_text.hpp"

namespace fclib::hdf5 {

namespace {

namespace fs = std::filesystem;

/// HDF5 ends the process if another version is loaded than that of the build.
void require_same_version() {
  static const bool same = hdf5_loaded_version() == hdf5_compiled_version() ||
                           std::getenv("HDF5_DISABLE_VERSION_CHECK") != nullptr;
  if (!same) {
    fail("", "HDF5 " + hdf5_loaded_version() + " is loaded, but fclib was built with HDF5 " +
                 hdf5_compiled_version() + ": build fclib anew, or put that HDF5 first");
  }
}

std::mutex& library_mutex() {
  static std::mutex instance;
  return instance;
}

/// The folder in which HDF5 looks for the file of an external link.
std::array<fs::path, 2> places_of(const char* from, const char* to) {
  return {fs::path(to), fs::path(from).parent_path() / to};
}

/// No external link is followed: a file from elsewhere could name any file of its reader.
herr_t follow_none(const char*, const char*, const char*, const char*, unsigned*, hid_t, void*) {
  return -1;
}

/// What is wrong with a name that leads to no object.
std::string words_of_link(hid_t group, const std::string& name) {
  H5L_info_t link;
  const bool known = H5Lget_info(group, name.c_str(), &link, H5P_DEFAULT) >= 0;
  if (!known || link.type == H5L_TYPE_HARD) {
    return "cannot be looked up by HDF5 (the file is damaged)";
  }
  std::string value(link.u.val_size + 1, '\0');
  if (H5Lget_val(group, name.c_str(), value.data(), value.size(), H5P_DEFAULT) < 0) {
    return "is a link that HDF5 cannot read";
  }
  if (link.type == H5L_TYPE_SOFT) {
    return "is a link to " + quoted(value.c_str()) + ", which is not there";
  }
  const char* file = nullptr;
  const char* object = nullptr;
  if (link.type != H5L_TYPE_EXTERNAL ||
      H5Lunpack_elink_val(value.data(), link.u.val_size, nullptr, &file, &object) < 0) {
    return "is a link of a kind that is not followed";
  }
  std::string own(
      static_cast<std::size_t>(std::max<ssize_t>(H5Fget_name(group, nullptr, 0), 0)) + 1, '\0');
  H5Fget_name(group, own.data(), own.size());
  bool there = false;
  for (const fs::path& target : places_of(own.c_str(), file)) {
    std::error_code error;
    there = there || fs::exists(target, error);
  }
  const std::string words =
      "is an external link to " + quoted(object) + " of the file " + quoted(file) + ", ";
  return words + (there ? "which is not followed" : "which is not there") +
         ": copy what it links to into this file";
}

Session* current = nullptr;  // protected by the lock

/// The bytes of a file from an offset on, as many as there are.
std::string bytes_of(const std::string& path, std::size_t from, std::size_t count) {
  std::ifstream file(path, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(from));
  std::string bytes(count, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(count));
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  return bytes;
}

/// The marks that a program leaves in byte 11 of a superblock of version 3 while it writes to the
/// file: that it may be read meanwhile is the third bit.
constexpr std::size_t version_byte = 8;
constexpr std::size_t flags_byte = 11;
constexpr int readable_while_written = 4;

/// Opens a file that grows while it is read, or whose writer was killed so.
Handle open_growing(const std::string& path) {
  const std::string block = bytes_of(path, 0, flags_byte + 1);
  if (block.size() <= flags_byte || block[version_byte] != 3 ||
      (block[flags_byte] & readable_while_written) == 0) {
    return {-1, H5Fclose};
  }
  // HDF5 waits 1, 2, 4, ... ns if a checksum is wrong: the writer may be at work there. By its
  // default a damaged file would take minutes. This is 30 ms
  constexpr unsigned attempts = 25;
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_metadata_read_attempts(access.id(), attempts);
  return {H5Fopen(path.c_str(), H5F_ACC_RDONLY | H5F_ACC_SWMR_READ, access.id()), H5Fclose};
}

/// Why an HDF5 file cannot be opened. A program that writes a file in a newer format says so in
/// byte 11 of its superblock, and takes that back at the end.
std::string what_is_wrong_with(const std::string& path) {
  constexpr std::string_view signature("\x89HDF\r\n\x1a\n", 8);
  // HDF5 looks for its superblock at 0, 512, 1024, 2048, ...
  for (std::size_t at = 0;; at = at == 0 ? 512 : 2 * at) {
    const std::string block = bytes_of(path, at, flags_byte + 1);
    if (block.size() <= flags_byte) break;
    if (!block.starts_with(signature)) continue;
    if (block[version_byte] < 2 || block[flags_byte] == 0) break;
    return "was not closed by the program that wrote it. If that program has ended, run 'h5clear "
           "-s " +
           path + "'; what it had not yet written is missing";
  }
  return "cannot be opened by HDF5 (the file is damaged or cut short)";
}

/// What kind of file a file is that is not HDF5.
std::string what_else_is(const std::string& path) {
  constexpr std::size_t enough = 256;
  const std::string start = bytes_of(path, 0, enough);
  if (start.empty()) return "is not an HDF5 file: it is empty";
  if (start.starts_with("version https://git-lfs.github.com/spec/")) {
    return "is a pointer of Git LFS, not the file itself: run 'git lfs pull'";
  }
  // a file of Siconos begins with the components of a contact, the number of contacts, and a
  // storage
  int numbers[3] = {};
  std::istringstream text(start);
  for (int& number : numbers) text >> number;
  if (text && numbers[0] >= 2 && numbers[0] <= 5 && numbers[1] >= 0 && numbers[2] >= 0) {
    return "is not an HDF5 file. If it is the text of Siconos (.dat), convert it: 'fclib convert " +
           path + " NEW.hdf5'";
  }
  return "is not an HDF5 file";
}

}  // namespace

void fail(const std::string& where, const std::string& message) {
  throw Error(ErrorKind::file, message, where);
}

void check(herr_t status, const std::string& where) {
  if (status < 0) fail(where, "cannot be written by HDF5");
}

Session::Session() : lock_(library_mutex()) {
  require_same_version();
  H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  current = this;
}

Session::~Session() {
  current = nullptr;
  H5Eset_auto2(H5E_DEFAULT, function_, data_);
}

hid_t Session::link_access() {
  std::optional<Handle>& made = current->link_access_;
  if (!made) {
    made.emplace(H5Pcreate(H5P_LINK_ACCESS), H5Pclose);
    H5Pset_elink_cb(made->id(), follow_none, nullptr);
  }
  return made->id();
}

std::string Group::child(std::string_view name) const {
  return (path == "/" ? "/" : path + "/") + std::string(name);
}

bool Group::has(const std::string& name) const {
  if (H5Oexists_by_name(id, name.c_str(), Session::link_access()) > 0) return true;
  // an object that cannot be looked up is not a missing one, nor is a link to nothing
  const htri_t found = H5Lexists(id, name.c_str(), H5P_DEFAULT);
  if (found < 0) fail(child(name), "cannot be looked up by HDF5 (the file is damaged)");
  if (found > 0) fail(child(name), words_of_link(id, name));
  return false;
}

Handle open_group(const Group& parent, const std::string& name) {
  if (!parent.has(name)) fail(parent.child(name), "the group is missing");
  Handle group(H5Gopen2(parent.id, name.c_str(), H5P_DEFAULT), H5Gclose);
  if (!group.ok()) fail(parent.child(name), "is not a group");
  return group;
}

Handle open_file(const std::string& path) {
  std::error_code error;
  const auto status = fs::status(path, error);
  if (!fs::exists(status)) fail("", "there is no such file");
  if (fs::is_directory(status)) fail("", "is a directory, expected an FCLIB file");
  if (!fs::is_regular_file(status)) fail("", "is not a regular file");
  if (const std::string why = why_unreadable(path); !why.empty()) {
    fail("", "cannot be opened: " + why);
  }
  if (Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose); file.ok()) {
    return file;
  }
  Handle file = open_growing(path);
  if (!file.ok()) {
    // HDF5 locks a file that it may write to
    if (is_locked(path)) fail("", "another program has it open, and may write to it");
    fail("", H5Fis_hdf5(path.c_str()) > 0 ? what_is_wrong_with(path) : what_else_is(path));
  }
  return file;
}

}  // namespace fclib::hdf5
