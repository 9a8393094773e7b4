#include "io/hdf5/handles.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "io/hdf5/library.hpp"

namespace fclib::hdf5 {

namespace {

namespace fs = std::filesystem;

/// HDF5 ends the process where another version is loaded than it was compiled with.
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

/// No external link is followed: a file from elsewhere could name any file of its reader's.
herr_t follow_none(const char*, const char*, const char*, const char*, unsigned*, hid_t, void*) {
  return -1;
}

Session* current = nullptr;  // under the lock

/// Whether a program has a file open to write it: HDF5 locks it meanwhile.
bool is_being_written(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return false;
  const bool locked = flock(file, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  close(file);
  return locked;
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
  // what cannot be looked up is not what is not there
  const htri_t linked = H5Lexists(id, name.c_str(), H5P_DEFAULT);
  if (linked < 0) fail(child(name), "cannot be looked up by HDF5 (the file is damaged)");
  H5L_info_t link;
  if (linked > 0 && H5Lget_info(id, name.c_str(), &link, H5P_DEFAULT) >= 0 &&
      link.type == H5L_TYPE_EXTERNAL) {
    fail(child(name), "is a link into another file, and is not followed: copy what it links to");
  }
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
  if (access(path.c_str(), R_OK) != 0) {
    fail("", "cannot be opened: " + std::string(std::strerror(errno)));
  }
  Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!file.ok()) {
    if (is_being_written(path)) fail("", "another program has it open, and may write to it");
    fail("", H5Fis_hdf5(path.c_str()) > 0
                 ? "cannot be opened by HDF5 (the file is damaged or cut short)"
                 : "is not an HDF5 file");
  }
  return file;
}

}  // namespace fclib::hdf5
