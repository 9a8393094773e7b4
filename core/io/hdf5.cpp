#include "io/hdf5.hpp"

#include <hdf5.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <mutex>

#include "version.hpp"

namespace fclib {

namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string& where, const std::string& message) {
  throw Error(ErrorKind::file, message, where);
}

std::string system_message() { return std::strerror(errno); }

/// Holds the library's lock, and keeps HDF5 from printing its error stack to the host's stderr.
class Session {
 public:
  Session() : lock_(mutex()) {
    H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~Session() { H5Eset_auto2(H5E_DEFAULT, function_, data_); }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

 private:
  static std::mutex& mutex() {
    static std::mutex instance;
    return instance;
  }
  std::lock_guard<std::mutex> lock_;
  H5E_auto2_t function_ = nullptr;
  void* data_ = nullptr;
};

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

/// A group of an open file and its path, which every message names.
struct Group {
  hid_t id;
  std::string path;

  [[nodiscard]] std::string child(std::string_view name) const {
    return (path == "/" ? "/" : path + "/") + std::string(name);
  }
  [[nodiscard]] bool has(const std::string& name) const {
    return H5Lexists(id, name.c_str(), H5P_DEFAULT) > 0 &&
           H5Oexists_by_name(id, name.c_str(), H5P_DEFAULT) > 0;
  }
};

// ---- reading ----------------------------------------------------------------------------------

Handle open_group(const Group& parent, const std::string& name) {
  const std::string path = parent.child(name);
  if (!parent.has(name)) fail(path, "the group is missing");
  Handle group(H5Gopen2(parent.id, name.c_str(), H5P_DEFAULT), H5Gclose);
  if (!group.ok()) fail(path, "is not a group");
  return group;
}

/// An open dataset whose type and size have been looked at, and found believable.
struct Dataset {
  Handle id;
  std::string path;
  std::size_t size;
};

/// deflate cannot shrink data further than this
constexpr double best_compression = 1100.0;
constexpr std::size_t small_dataset = std::size_t{1} << 20;

Dataset open_numbers(const Group& group, const std::string& name, bool integers) {
  const std::string path = group.child(name);
  if (!group.has(name)) fail(path, "the dataset is missing");
  Handle dataset(H5Dopen2(group.id, name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!dataset.ok()) fail(path, "is not a dataset that HDF5 can open");
  const Handle type(H5Dget_type(dataset.id()), H5Tclose);
  const H5T_class_t kind = H5Tget_class(type.id());
  if (integers && kind != H5T_INTEGER) fail(path, "does not hold integers");
  if (kind != H5T_INTEGER && kind != H5T_FLOAT) fail(path, "does not hold numbers");
  const Handle space(H5Dget_space(dataset.id()), H5Sclose);
  const hssize_t points = H5Sget_simple_extent_npoints(space.id());
  if (points < 0) fail(path, "has no size");
  if (H5Sget_simple_extent_ndims(space.id()) > 1) fail(path, "has more than one dimension");
  const auto size = static_cast<std::size_t>(points);
  const double bytes = static_cast<double>(size) * static_cast<double>(H5Tget_size(type.id()));
  if (bytes > static_cast<double>(small_dataset) &&
      bytes > best_compression * static_cast<double>(H5Dget_storage_size(dataset.id()))) {
    fail(path, "declares " + std::to_string(size) + " entries, but the file does not hold them");
  }
  return {std::move(dataset), path, size};
}

template <class Number>
std::vector<Number> read_numbers(const Group& group, const std::string& name) {
  constexpr bool integers = std::is_integral_v<Number>;
  const Dataset dataset = open_numbers(group, name, integers);
  using Wide = std::conditional_t<integers, std::int64_t, double>;
  std::vector<Wide> wide(dataset.size);
  const hid_t memory = integers ? H5T_NATIVE_INT64 : H5T_NATIVE_DOUBLE;
  if (dataset.size > 0 &&
      H5Dread(dataset.id.id(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, wide.data()) < 0) {
    fail(dataset.path, "cannot be read (the file is damaged or cut short)");
  }
  if constexpr (std::is_same_v<Number, Wide>) {
    return wide;
  } else {
    std::vector<Number> result(wide.size());
    for (std::size_t k = 0; k < wide.size(); ++k) {
      if (wide[k] < std::numeric_limits<Number>::min() ||
          wide[k] > std::numeric_limits<Number>::max()) {
        fail(dataset.path + "[" + std::to_string(k) + "]",
             std::to_string(wide[k]) + " does not fit a 32-bit integer");
      }
      result[k] = static_cast<Number>(wide[k]);
    }
    return result;
  }
}

template <class Number>
Number read_number(const Group& group, const std::string& name) {
  const auto values = read_numbers<Number>(group, name);
  if (values.size() != 1) {
    fail(group.child(name), "has " + std::to_string(values.size()) + " entries, expected one");
  }
  return values.front();
}

/// Text of fixed length, with or without its final NUL, or of variable length.
std::string read_text(const Group& group, const std::string& name) {
  const std::string path = group.child(name);
  const Handle dataset(H5Dopen2(group.id, name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!dataset.ok()) fail(path, "is not a dataset that HDF5 can open");
  const Handle type(H5Dget_type(dataset.id()), H5Tclose);
  const Handle space(H5Dget_space(dataset.id()), H5Sclose);
  if (H5Tget_class(type.id()) != H5T_STRING) fail(path, "does not hold text");
  if (H5Sget_simple_extent_npoints(space.id()) != 1) fail(path, "does not hold one text");
  if (H5Tis_variable_str(type.id()) > 0) {
    char* value = nullptr;
    if (H5Dread(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, &value) < 0) {
      fail(path, "cannot be read");
    }
    std::string text = value != nullptr ? value : "";
    H5Dvlen_reclaim(type.id(), space.id(), H5P_DEFAULT, &value);
    return text;
  }
  const std::size_t length = H5Tget_size(type.id());
  if (length > small_dataset && length > H5Dget_storage_size(dataset.id())) {
    fail(path,
         "declares a text of " + std::to_string(length) + " bytes that the file does not hold");
  }
  std::string text(length, '\0');
  if (H5Dread(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, text.data()) < 0) {
    fail(path, "cannot be read");
  }
  text.resize(std::min(text.find('\0'), text.size()));
  return text;
}

template <class Number>
void shorten(std::vector<Number>& values, std::size_t length, const std::string& where) {
  if (values.size() < length) {
    fail(where,
         "has " + std::to_string(values.size()) + " entries, expected " + std::to_string(length));
  }
  values.resize(length);
}

constexpr Index nz_csc = -1;
constexpr Index nz_csr = -2;
constexpr Index nz_dense = -3;

std::optional<MatrixInfo> read_matrix_info(const Group& group) {
  if (!group.has("comment") && !group.has("conditioning") && !group.has("rank")) return {};
  MatrixInfo info;
  if (group.has("comment")) info.comment = read_text(group, "comment");
  if (group.has("conditioning")) info.conditioning = read_number<double>(group, "conditioning");
  if (group.has("determinant")) info.determinant = read_number<double>(group, "determinant");
  if (group.has("rank")) info.rank = read_number<Index>(group, "rank");
  return info;
}

Matrix read_matrix(const Group& parent, const std::string& name) {
  const Handle handle = open_group(parent, name);
  const Group group{handle.id(), parent.child(name)};
  Matrix a;
  a.rows = read_number<Index>(group, "m");
  a.cols = read_number<Index>(group, "n");
  if (a.rows < 0) fail(group.child("m"), "is negative");
  if (a.cols < 0) fail(group.child("n"), "is negative");
  const Index nz = read_number<Index>(group, "nz");
  a.x = read_numbers<double>(group, "x");
  if (nz == nz_dense) {
    a.storage = Storage::dense;
  } else {
    a.p = read_numbers<Index>(group, "p");
    a.i = read_numbers<Index>(group, "i");
    auto entries = static_cast<std::size_t>(std::max(nz, 0));
    if (nz >= 0) {
      a.storage = Storage::triplet;
      shorten(a.p, entries, group.child("p"));
    } else if (nz == nz_csc || nz == nz_csr) {
      a.storage = nz == nz_csc ? Storage::csc : Storage::csr;
      if (a.p.empty() || a.p.back() < 0) fail(group.child("p"), "has no valid last pointer");
      entries = static_cast<std::size_t>(a.p.back());
    } else {
      fail(group.child("nz"), std::to_string(nz) +
                                  " is no storage: expected the number of triplets, "
                                  "-1 (CSC), -2 (CSR) or -3 (dense)");
    }
    // nzmax may leave room at the end
    shorten(a.i, entries, group.child("i"));
    shorten(a.x, entries, group.child("x"));
  }
  a.info = read_matrix_info(group);
  return a;
}

Vector read_vector(const Group& group, const std::string& name) {
  const auto values = read_numbers<double>(group, name);
  return Eigen::Map<const Vector>(values.data(), static_cast<Eigen::Index>(values.size()));
}

ProblemInfo read_info(const Group& parent) {
  ProblemInfo info;
  if (!parent.has("info")) return info;
  const Handle handle = open_group(parent, "info");
  const Group group{handle.id(), parent.child("info")};
  for_each_field<ProblemInfo>([&](const auto& field) {
    const std::string name(field.name);
    if (group.has(name)) info.*field.member = read_text(group, name);
  });
  return info;
}

template <class P>
P read_fields(const Group& root) {
  const Handle handle = open_group(root, group_name<P>());
  const Group group{handle.id(), root.child(group_name<P>())};
  const Handle vectors_handle = open_group(group, "vectors");
  const Group vectors{vectors_handle.id(), group.child("vectors")};
  P problem;
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    const std::string name(field.name);
    const Group& place = std::is_same_v<Member, Vector> ? vectors : group;
    if (field.presence != Presence::required && !place.has(name)) return;
    if constexpr (std::is_same_v<Member, Matrix>) {
      problem.*field.member = read_matrix(place, name);
    } else if constexpr (std::is_same_v<Member, Vector>) {
      problem.*field.member = read_vector(place, name);
    } else {
      problem.*field.member = read_number<Member>(place, name);
    }
  });
  problem.info = read_info(group);
  return problem;
}

void require_regular(const fs::file_status& status) {
  if (fs::is_directory(status)) fail("", "is a directory, expected an FCLIB file");
  if (fs::exists(status) && !fs::is_regular_file(status)) fail("", "is not a regular file");
}

Handle open_file(const std::string& path) {
  std::error_code error;
  const auto status = fs::status(path, error);
  if (!fs::exists(status)) fail("", "there is no such file");
  require_regular(status);
  if (access(path.c_str(), R_OK) != 0) fail("", "cannot be opened: " + system_message());
  if (H5Fis_hdf5(path.c_str()) <= 0) fail("", "is not an HDF5 file");
  Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!file.ok()) fail("", "cannot be opened by HDF5 (the file is damaged or cut short)");
  return file;
}

Contents contents_of(const Group& root) {
  Contents contents;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if (root.has(group_name<P>())) contents.kinds.emplace_back(P::kind);
  });
  contents.solution = root.has("solution");
  return contents;
}

/// Runs body(), and says of any error in which file it was.
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

// ---- writing ----------------------------------------------------------------------------------

/// Smaller datasets are not worth a chunk and a filter.
constexpr std::size_t chunked_from = 256;
constexpr std::size_t chunk_entries = std::size_t{1} << 16;
constexpr unsigned deflate_level = 4;

void check(herr_t status, const std::string& where) {
  if (status < 0) fail(where, "cannot be written by HDF5");
}

Handle create_group(const Group& parent, const std::string& name) {
  Handle group(H5Gcreate2(parent.id, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
               H5Gclose);
  if (!group.ok()) fail(parent.child(name), "cannot be created");
  return group;
}

void write_array(const Group& group, const std::string& name, hid_t stored, hid_t memory,
                 const void* data, std::size_t size) {
  const std::string path = group.child(name);
  const hsize_t extent = size;
  const Handle space(H5Screate_simple(1, &extent, nullptr), H5Sclose);
  const Handle layout(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_obj_track_times(layout.id(), false);  // the same problem gives the same bytes
  if (size >= chunked_from) {
    const hsize_t chunk = std::min(size, chunk_entries);
    H5Pset_chunk(layout.id(), 1, &chunk);
    H5Pset_shuffle(layout.id());
    H5Pset_deflate(layout.id(), deflate_level);
  }
  const Handle dataset(
      H5Dcreate2(group.id, name.c_str(), stored, space.id(), H5P_DEFAULT, layout.id(), H5P_DEFAULT),
      H5Dclose);
  if (!dataset.ok()) fail(path, "cannot be created");
  if (size > 0) check(H5Dwrite(dataset.id(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, data), path);
}

void write_numbers(const Group& group, const std::string& name, const std::vector<Index>& values) {
  write_array(group, name, H5T_STD_I32LE, H5T_NATIVE_INT32, values.data(), values.size());
}
void write_numbers(const Group& group, const std::string& name, const std::vector<double>& values) {
  write_array(group, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values.data(), values.size());
}
void write_number(const Group& group, const std::string& name, Index value) {
  write_numbers(group, name, std::vector<Index>{value});
}
void write_number(const Group& group, const std::string& name, double value) {
  write_numbers(group, name, std::vector<double>{value});
}
void write_vector(const Group& group, const std::string& name, const Vector& values) {
  write_array(group, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values.data(),
              static_cast<std::size_t>(values.size()));
}

Handle text_type(const std::string& text) {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.id(), text.size() + 1);
  return type;
}

void write_text(const Group& group, const std::string& name, const std::string& text) {
  const Handle type = text_type(text);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle layout(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_obj_track_times(layout.id(), false);
  const Handle dataset(H5Dcreate2(group.id, name.c_str(), type.id(), space.id(), H5P_DEFAULT,
                                  layout.id(), H5P_DEFAULT),
                       H5Dclose);
  if (!dataset.ok()) fail(group.child(name), "cannot be created");
  check(H5Dwrite(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, text.c_str()),
        group.child(name));
}

void write_text_attribute(const Group& group, const char* name, const std::string& text) {
  const Handle type = text_type(text);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(
      H5Acreate2(group.id, name, type.id(), space.id(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (!attribute.ok()) fail(group.path, std::string("attribute ") + name + " cannot be created");
  check(H5Awrite(attribute.id(), type.id(), text.c_str()), group.path);
}

void write_matrix(const Group& parent, const std::string& name, const Matrix& a) {
  const Handle handle = create_group(parent, name);
  const Group group{handle.id(), parent.child(name)};
  const auto nnz = static_cast<Index>(a.nnz());
  const auto nz = [&]() -> Index {
    switch (a.storage) {
      case Storage::triplet:
        return nnz;
      case Storage::csc:
        return nz_csc;
      case Storage::csr:
        return nz_csr;
      case Storage::dense:
        return nz_dense;
    }
    return nnz;
  }();
  write_number(group, "nzmax", nnz);
  write_number(group, "m", a.rows);
  write_number(group, "n", a.cols);
  write_number(group, "nz", nz);
  if (a.storage != Storage::dense) {
    write_numbers(group, "p", a.p);
    write_numbers(group, "i", a.i);
  }
  write_numbers(group, "x", a.x);
  if (a.info) {
    write_text(group, "comment", a.info->comment);
    write_number(group, "conditioning", a.info->conditioning);
    write_number(group, "determinant", a.info->determinant);
    write_number(group, "rank", a.info->rank);
  }
}

template <class P>
void write_fields(const Group& root, const P& problem) {
  const Handle handle = create_group(root, group_name<P>());
  const Group group{handle.id(), root.child(group_name<P>())};
  const Handle vectors_handle = create_group(group, "vectors");
  const Group vectors{vectors_handle.id(), group.child("vectors")};
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    const std::string name(field.name);
    if (field.presence == Presence::mixed && !is_mixed(problem)) return;
    if constexpr (std::is_same_v<Member, Matrix>) {
      const Matrix& a = problem.*field.member;
      write_matrix(group, name, P::triplets_on_disk ? converted(a, Storage::triplet) : a);
    } else if constexpr (std::is_same_v<Member, Vector>) {
      write_vector(vectors, name, problem.*field.member);
    } else {
      write_number(group, name, problem.*field.member);
    }
  });
  const Handle info_handle = create_group(group, "info");
  const Group info{info_handle.id(), group.child("info")};
  for_each_field<ProblemInfo>([&](const auto& field) {
    write_text(info, std::string(field.name), problem.info.*field.member);
  });
}

void write_solution_group(const Group& root, const Solution& solution) {
  if (root.has("solution")) check(H5Ldelete(root.id, "solution", H5P_DEFAULT), "/solution");
  const Handle handle = create_group(root, "solution");
  const Group group{handle.id(), root.child("solution")};
  for_each_field<Solution>([&](const auto& field) {
    const Vector& values = solution.*field.member;
    if (field.presence != Presence::required && values.size() == 0) return;
    write_vector(group, std::string(field.name), values);
  });
}

/// Where a path leads to, through links; the last one may point to a file that is not there yet.
std::string resolve(const std::string& path) {
  fs::path target(path);
  std::error_code error;
  for (int hops = 0; hops < 40 && fs::is_symlink(target, error); ++hops) {
    target = target.parent_path() / fs::read_symlink(target, error);
  }
  return target.string();
}

/// Writes all bytes, or says why not.
void write_bytes(int file, const std::vector<char>& bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = ::write(file, bytes.data() + done, bytes.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) fail("", "cannot be written: " + system_message());
    done += static_cast<std::size_t>(count);
  }
  if (::fsync(file) != 0) fail("", "cannot be written: " + system_message());
}

/// Puts the bytes in the place of the file, all or none: they go into a file beside it, which is
/// renamed over it.
void replace_file(const std::string& path, const std::vector<char>& bytes) {
  const std::string target = resolve(path);
  std::error_code error;
  const auto status = fs::status(target, error);
  require_regular(status);
  mode_t mode = 0;
  if (fs::exists(status)) {
    if (access(target.c_str(), W_OK) != 0) fail("", "cannot be written: " + system_message());
    mode = static_cast<mode_t>(status.permissions());
  } else {
    mode = ::umask(0);
    ::umask(mode);
    mode = 0666U & ~mode;
  }
  std::string temporary = target + ".XXXXXX";
  const int file = ::mkstemp(temporary.data());
  if (file < 0) fail("", "cannot be written: " + system_message());
  try {
    ::fchmod(file, mode);
    write_bytes(file, bytes);
    if (::rename(temporary.c_str(), target.c_str()) != 0) {
      fail("", "cannot be written: " + system_message());
    }
  } catch (...) {
    ::close(file);
    ::unlink(temporary.c_str());
    throw;
  }
  ::close(file);
}

/// An HDF5 file in memory. HDF5 never writes to a disk itself: what fails there (a full disk) it
/// does not survive in good order.
class MemoryFile {
 public:
  /// An empty file.
  MemoryFile() : access_(core_driver()), file_(create(access_.id())) {}
  /// The file that these bytes are.
  explicit MemoryFile(const std::vector<char>& bytes)
      : access_(core_driver()), file_(open(access_.id(), bytes)) {}

  [[nodiscard]] Group root() const { return {file_.id(), "/"}; }

  [[nodiscard]] std::vector<char> bytes() const {
    check(H5Fflush(file_.id(), H5F_SCOPE_LOCAL), "");
    const ssize_t size = H5Fget_file_image(file_.id(), nullptr, 0);
    if (size <= 0) fail("", "cannot be put together by HDF5");
    std::vector<char> result(static_cast<std::size_t>(size));
    if (H5Fget_file_image(file_.id(), result.data(), result.size()) != size) {
      fail("", "cannot be put together by HDF5");
    }
    return result;
  }

 private:
  static Handle core_driver() {
    constexpr std::size_t increment = std::size_t{1} << 20;
    Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    check(H5Pset_fapl_core(access.id(), increment, false), "");
    return access;
  }
  static Handle create(hid_t access) {
    Handle file(H5Fcreate("new", H5F_ACC_TRUNC, H5P_DEFAULT, access), H5Fclose);
    if (!file.ok()) fail("", "cannot be created by HDF5");
    return file;
  }
  static Handle open(hid_t access, const std::vector<char>& bytes) {
    std::vector<char> copy = bytes;
    check(H5Pset_file_image(access, copy.data(), copy.size()), "");
    Handle file(H5Fopen("image", H5F_ACC_RDWR, access), H5Fclose);
    if (!file.ok()) fail("", "cannot be opened by HDF5 (the file is damaged or cut short)");
    return file;
  }

  Handle access_;
  Handle file_;
};

std::vector<char> read_bytes(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::vector<char> bytes{std::istreambuf_iterator<char>(stream), {}};
  if (!stream) fail("", "cannot be read: " + system_message());
  return bytes;
}

}  // namespace

Contents read_contents(const std::string& path) {
  const Session session;
  return in_file(path, [&] {
    const Handle file = open_file(path);
    return contents_of({file.id(), "/"});
  });
}

Problem read_problem(const std::string& path, std::string_view kind) {
  const Session session;
  return in_file(path, [&] {
    const Handle file = open_file(path);
    const Group root{file.id(), "/"};
    const Contents contents = contents_of(root);
    std::string known;
    for (const auto& name : contents.kinds) known += (known.empty() ? "" : ", ") + name;
    if (kind.empty()) {
      if (contents.kinds.empty()) fail("/", "holds no problem in a known FCLIB layout");
      if (contents.kinds.size() > 1) fail("/", "holds several problems, name one of: " + known);
    } else if (std::find(contents.kinds.begin(), contents.kinds.end(), kind) ==
               contents.kinds.end()) {
      fail("/", "holds no " + std::string(kind) + " problem" +
                    (known.empty() ? "" : "; it holds: " + known));
    }
    const std::string wanted = kind.empty() ? contents.kinds.front() : std::string(kind);
    Problem problem;
    for_each_formulation([&]<class P>(std::type_identity<P>) {
      if (wanted != P::kind) return;
      P read = read_fields<P>(root);
      validate(read);
      problem = std::move(read);
    });
    return problem;
  });
}

std::optional<Solution> read_solution(const std::string& path) {
  const Session session;
  return in_file(path, [&]() -> std::optional<Solution> {
    const Handle file = open_file(path);
    const Group root{file.id(), "/"};
    if (!root.has("solution")) return std::nullopt;
    const Handle handle = open_group(root, "solution");
    const Group group{handle.id(), "/solution"};
    Solution solution;
    for_each_field<Solution>([&](const auto& field) {
      const std::string name(field.name);
      if (field.presence == Presence::required || group.has(name)) {
        solution.*field.member = read_vector(group, name);
      }
    });
    return solution;
  });
}

void write_file(const std::string& path, ProblemPointer problem, const Solution* solution) {
  const Session session;
  in_file(path, [&] {
    std::visit(
        [&](const auto* p) {
          validate(*p);
          if (solution != nullptr) validate(*solution, *p);
        },
        problem);
    const MemoryFile file;
    const Group root = file.root();
    write_text_attribute(root, "format", format_version);
    write_text_attribute(root, "generator", "fclib " + std::string(version));
    std::visit([&](const auto* p) { write_fields(root, *p); }, problem);
    if (solution != nullptr) write_solution_group(root, *solution);
    replace_file(path, file.bytes());
  });
}

void write_solution(const std::string& path, const Solution& solution) {
  const Problem problem = read_problem(path);
  const Session session;
  in_file(path, [&] {
    std::visit([&](const auto& p) { validate(solution, p); }, problem);
    const MemoryFile file(read_bytes(path));
    write_solution_group(file.root(), solution);
    replace_file(path, file.bytes());
  });
}

}  // namespace fclib
