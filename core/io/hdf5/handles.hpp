// What every use of HDF5 goes through: the lock, identifiers that close themselves, groups that
// know their paths, and errors.
//
// Internal to io/hdf5/, like all of namespace fclib::hdf5: the headers that others include do not
// include hdf5.h.
#pragma once

#include <hdf5.h>

#include <mutex>
#include <new>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "error.hpp"
#include "io/replace_file.hpp"

namespace fclib::hdf5 {

/// Throws Error (file).
[[noreturn]] void fail(const std::string& where, const std::string& message);

/// Throws if HDF5 could not write.
void check(herr_t status, const std::string& where);

/// An HDF5 identifier that closes itself.
class Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Handle(hid_t id, Close close) : id_(id), close_(close) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  Handle& operator=(Handle&&) = delete;
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  [[nodiscard]] hid_t id() const { return id_; }
  [[nodiscard]] bool ok() const { return id_ >= 0; }

 private:
  hid_t id_;
  Close close_;
};

/// Holds the library's lock, and keeps HDF5 from printing its error stack to the host's stderr.
/// Throws if the HDF5 that is loaded has another version than the one at compile time.
class Session {
 public:
  Session();
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// How the session that holds the lock follows links.
  static hid_t link_access();

 private:
  std::lock_guard<std::mutex> lock_;
  std::optional<Handle> link_access_;  // made at its first use, since it takes long
  H5E_auto2_t function_ = nullptr;
  void* data_ = nullptr;
};

/// A group of an open file and its path, which every message names.
struct Group {
  hid_t id;
  std::string path;

  [[nodiscard]] std::string child(std::string_view name) const;
  /// Whether there is an object of this name. Throws if the name is a link to nothing.
  [[nodiscard]] bool has(const std::string& name) const;
};

Handle open_group(const Group& parent, const std::string& name);

/// Opens a file to read it. Its errors say most precisely what is wrong with the file.
Handle open_file(const std::string& path);

/// Runs body(), and adds to any error in which file it was.
template <class Body>
auto in_file(const std::string& path, const Body& body) {
  try {
    return body();
  } catch (const Error& error) {
    throw error.in_file(path);
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::file, "there is not enough memory to read it", {}, path);
  }
}

}  // namespace fclib::hdf5
