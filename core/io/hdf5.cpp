#include "io/hdf5.hpp"

#include <fcntl.h>
#include <hdf5.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <mutex>

#include "io/replace_file.hpp"
#include "version.hpp"

namespace fclib {

std::string hdf5_compiled_version() {
  return std::to_string(H5_VERS_MAJOR) + "." + std::to_string(H5_VERS_MINOR) + "." +
         std::to_string(H5_VERS_RELEASE);
}

std::string hdf5_loaded_version() {
  unsigned major = 0;
  unsigned minor = 0;
  unsigned release = 0;
  H5get_libversion(&major, &minor, &release);
  return std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(release);
}

namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string& where, const std::string& message) {
  throw Error(ErrorKind::file, message, where);
}

std::string system_message() { return std::strerror(errno); }

/// HDF5 ends the process where another version is loaded than it was compiled with.
void require_same_version() {
  static const bool same = hdf5_loaded_version() == hdf5_compiled_version() ||
                           std::getenv("HDF5_DISABLE_VERSION_CHECK") != nullptr;
  if (!same) {
    fail("", "HDF5 " + hdf5_loaded_version() + " is loaded, but fclib was built with HDF5 " +
                 hdf5_compiled_version() + ": build fclib anew, or put that HDF5 first");
  }
}

/// Holds the library's lock, and keeps HDF5 from printing its error stack to the host's stderr.
class Session {
 public:
  Session() : lock_(mutex()) {
    require_same_version();
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
    const htri_t linked = H5Lexists(id, name.c_str(), H5P_DEFAULT);
    // what cannot be looked up is not what is not there
    if (linked < 0) fail(child(name), "cannot be looked up by HDF5 (the file is damaged)");
    return linked > 0 && H5Oexists_by_name(id, name.c_str(), H5P_DEFAULT) > 0;
  }
};

// ---- reading ----------------------------------------------------------------------------------

Handle open_group(const Group& parent, const std::string& name) {
  Handle group(H5Gopen2(parent.id, name.c_str(), H5P_DEFAULT), H5Gclose);
  if (!group.ok()) {
    fail(parent.child(name), parent.has(name) ? "is not a group" : "the group is missing");
  }
  return group;
}

/// An open dataset whose type and size have been looked at, and found believable.
struct Dataset {
  Handle id;
  std::string path;
  std::size_t size;
  bool narrow;  ///< holds integers of 32 bits at most, with their sign
};

/// deflate cannot shrink data further than this
constexpr double best_compression = 1100.0;
constexpr std::size_t small_dataset = std::size_t{1} << 20;

hsize_t size_of_file_with(hid_t object) {
  const Handle file(H5Iget_file_id(object), H5Fclose);
  hsize_t size = 0;
  H5Fget_filesize(file.id(), &size);
  return size;
}

/// What a dataset takes in its file, in bytes.
double stored_bytes(hid_t dataset) {
  return static_cast<double>(std::min(H5Dget_storage_size(dataset), size_of_file_with(dataset)));
}

/// The properties of a dataset, none where its data are in one piece in its file: to find that out
/// is cheap, to ask for properties is not. Throws where the data are in other files.
Handle properties_of(hid_t dataset, const std::string& path) {
  if (H5Dget_offset(dataset) != HADDR_UNDEF) return {-1, H5Pclose};
  Handle properties(H5Dget_create_plist(dataset), H5Pclose);
  if (!properties.ok()) fail(path, "has no properties that HDF5 can read");
  if (H5Pget_layout(properties.id()) == H5D_VIRTUAL || H5Pget_external_count(properties.id()) > 0) {
    fail(path, "keeps its data in other places, which are not read");
  }
  return properties;
}

/// Throws where HDF5 would ask for much more memory than the file has data, for chunks that are too
/// many or too large; and where it would unpack data by filters that trust what they read.
void require_chunks(const Handle& properties, hid_t dataset, double entries, double entry_size,
                    const std::string& path) {
  if (!properties.ok() || H5Pget_layout(properties.id()) != H5D_CHUNKED) return;
  hsize_t extents[H5S_MAX_RANK] = {};
  const int rank = H5Pget_chunk(properties.id(), H5S_MAX_RANK, extents);
  double chunk = 1;
  for (int k = 0; k < rank; ++k) chunk *= static_cast<double>(extents[k]);
  constexpr double many = 1024;
  constexpr double large = 1 << 26;
  const auto file_size = static_cast<double>(size_of_file_with(dataset));
  if (rank < 1 || chunk < 1 || entries / chunk > std::max(many, file_size) ||
      chunk * entry_size > std::max(large, best_compression * file_size)) {
    fail(path, "has chunks that the file does not hold");
  }
  for (int k = 0; k < H5Pget_nfilters(properties.id()); ++k) {
    std::size_t values = 0;
    const H5Z_filter_t filter = H5Pget_filter2(properties.id(), static_cast<unsigned>(k), nullptr,
                                               &values, nullptr, 0, nullptr, nullptr);
    if (filter == H5Z_FILTER_NBIT || filter == H5Z_FILTER_SCALEOFFSET) {
      fail(path, "is packed by a filter that is not read (n-bit or scale-offset)");
    }
  }
}

Dataset open_numbers(const Group& group, const std::string& name, bool integers) {
  const std::string path = group.child(name);
  Handle dataset(H5Dopen2(group.id, name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!dataset.ok()) {
    fail(path, group.has(name) ? "is not a dataset that HDF5 can open" : "the dataset is missing");
  }
  const Handle type(H5Dget_type(dataset.id()), H5Tclose);
  const H5T_class_t kind = H5Tget_class(type.id());
  if (integers && kind != H5T_INTEGER) fail(path, "does not hold integers");
  if (kind != H5T_INTEGER && kind != H5T_FLOAT) fail(path, "does not hold numbers");
  const Handle space(H5Dget_space(dataset.id()), H5Sclose);
  const hssize_t points = H5Sget_simple_extent_npoints(space.id());
  if (points < 0) fail(path, "has no size");
  if (H5Sget_simple_extent_ndims(space.id()) > 1) fail(path, "has more than one dimension");
  const auto size = static_cast<std::size_t>(points);
  const auto entry_size = static_cast<double>(H5Tget_size(type.id()));
  const double bytes = static_cast<double>(size) * entry_size;
  const Handle properties = properties_of(dataset.id(), path);
  if (bytes > static_cast<double>(small_dataset) &&
      bytes > best_compression * stored_bytes(dataset.id())) {
    fail(path, "declares " + std::to_string(size) + " entries, but the file does not hold them");
  }
  require_chunks(properties, dataset.id(), static_cast<double>(size), entry_size, path);
  if (size > static_cast<std::size_t>(std::numeric_limits<Index>::max())) {
    fail(path, "has " + std::to_string(size) + " entries, more than can be numbered");
  }
  const bool narrow = kind == H5T_INTEGER && H5Tget_precision(type.id()) <
                                                 (H5Tget_sign(type.id()) == H5T_SGN_NONE ? 32 : 33);
  return {std::move(dataset), path, size, narrow};
}

/// Values is a vector of numbers of the type `memory`.
template <class Values>
Values read_as(const Dataset& dataset, hid_t memory) {
  Values values(static_cast<decltype(Values().size())>(dataset.size));
  if (dataset.size > 0 &&
      H5Dread(dataset.id.id(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) {
    fail(dataset.path, "cannot be read (the file is damaged or cut short)");
  }
  return values;
}

template <class Doubles>
Doubles read_doubles(const Group& group, const std::string& name) {
  return read_as<Doubles>(open_numbers(group, name, false), H5T_NATIVE_DOUBLE);
}

template <class Indices>
Indices read_indices(const Group& group, const std::string& name) {
  const Dataset dataset = open_numbers(group, name, true);
  if (dataset.narrow) return read_as<Indices>(dataset, H5T_NATIVE_INT32);
  // HDF5 would clip what does not fit
  const auto wide = read_as<std::vector<std::int64_t>>(dataset, H5T_NATIVE_INT64);
  Indices result(wide.size());
  for (std::size_t k = 0; k < wide.size(); ++k) {
    if (wide[k] < std::numeric_limits<Index>::min() ||
        wide[k] > std::numeric_limits<Index>::max()) {
      fail(dataset.path + "[" + std::to_string(k) + "]",
           std::to_string(wide[k]) + " does not fit a 32-bit integer");
    }
    result[k] = static_cast<Index>(wide[k]);
  }
  return result;
}

template <class Number>
Number read_number(const Group& group, const std::string& name) {
  const auto values = [&] {
    if constexpr (std::is_integral_v<Number>) {
      return read_indices<std::vector<Number>>(group, name);
    } else {
      return read_doubles<std::vector<Number>>(group, name);
    }
  }();
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
  const std::size_t length = H5Tget_size(type.id());
  const Handle properties = properties_of(dataset.id(), path);
  require_chunks(properties, dataset.id(), 1, static_cast<double>(length), path);
  if (H5Tis_variable_str(type.id()) > 0) {
    char* value = nullptr;
    if (H5Dread(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, &value) < 0) {
      fail(path, "cannot be read");
    }
    std::string text = value != nullptr ? value : "";
    H5Dvlen_reclaim(type.id(), space.id(), H5P_DEFAULT, &value);
    return text;
  }
  if (length > small_dataset && static_cast<double>(length) > stored_bytes(dataset.id())) {
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

template <class Values>
void shorten(Values& values, std::size_t length, const std::string& where) {
  if (values.size() < length) {
    fail(where,
         "has " + std::to_string(values.size()) + " entries, expected " + std::to_string(length));
  }
  if constexpr (requires { values.shorten(length); }) {
    values.shorten(length);
  } else {
    values.resize(length);
  }
}

constexpr Index nz_csc = -1;
constexpr Index nz_csr = -2;
constexpr Index nz_dense = -3;

std::string read_text_if_there(const Group& group, const std::string& name,
                               const std::string& otherwise) {
  return group.has(name) ? read_text(group, name) : otherwise;
}

std::optional<MatrixInfo> read_matrix_info(const Group& group, const std::string& otherwise) {
  if (!group.has("comment") && !group.has("conditioning") && !group.has("determinant") &&
      !group.has("rank")) {
    return {};
  }
  MatrixInfo info;
  info.comment = read_text_if_there(group, "comment", otherwise);
  if (group.has("conditioning")) info.conditioning = read_number<double>(group, "conditioning");
  if (group.has("determinant")) info.determinant = read_number<double>(group, "determinant");
  if (group.has("rank")) info.rank = read_number<Index>(group, "rank");
  return info;
}

/// The sizes of a matrix; A is Matrix or RawMatrix.
template <class A>
A read_matrix_outline(const Group& group) {
  A a;
  a.rows = read_number<Index>(group, "m");
  a.cols = read_number<Index>(group, "n");
  if (a.rows < 0) fail(group.child("m"), "is negative");
  if (a.cols < 0) fail(group.child("n"), "is negative");
  return a;
}

template <class A>
A read_matrix(const Group& parent, const std::string& name) {
  constexpr bool raw = std::is_same_v<A, RawMatrix>;
  const Handle handle = open_group(parent, name);
  const Group group{handle.id(), parent.child(name)};
  A a = read_matrix_outline<A>(group);
  const auto rows = static_cast<std::size_t>(a.rows);
  const auto cols = static_cast<std::size_t>(a.cols);
  const Index nz = read_number<Index>(group, "nz");
  const auto read_entries = [&] { a.x = read_doubles<decltype(a.x)>(group, "x"); };
  if (nz == nz_dense) {
    a.storage = Storage::dense;
    read_entries();
    if constexpr (raw) shorten(a.x, rows * cols, group.child("x"));
  } else if (nz >= nz_csr) {
    a.p = read_indices<decltype(a.p)>(group, "p");
    a.i = read_indices<decltype(a.i)>(group, "i");
    read_entries();
    auto entries = static_cast<std::size_t>(std::max(nz, 0));
    if (nz >= 0) {
      a.storage = Storage::triplet;
      shorten(a.p, entries, group.child("p"));
    } else {
      a.storage = nz == nz_csc ? Storage::csc : Storage::csr;
      if constexpr (raw) {
        shorten(a.p, (nz == nz_csc ? cols : rows) + 1, group.child("p"));
        entries = std::max(a.i.size(), a.x.size());
      } else {
        if (a.p.empty() || a.p.back() < 0) fail(group.child("p"), "has no valid last pointer");
        entries = static_cast<std::size_t>(a.p.back());
      }
    }
    // nzmax may leave room at the end
    shorten(a.i, entries, group.child("i"));
    shorten(a.x, entries, group.child("x"));
  } else {
    fail(group.child("nz"), std::to_string(nz) +
                                " is no storage: expected the number of triplets, "
                                "-1 (CSC), -2 (CSR) or -3 (dense)");
  }
  a.info = read_matrix_info(group, raw ? absent_text : std::string());
  return a;
}

/// `otherwise` is the value of a text that is not there.
ProblemInfo read_info(const Group& parent, const std::string& otherwise) {
  ProblemInfo info;
  std::optional<Handle> handle;
  if (parent.has("info")) handle.emplace(open_group(parent, "info"));
  for_each_field<ProblemInfo>([&](const auto& field) {
    info.*field.member = handle ? read_text_if_there({handle->id(), parent.child("info")},
                                                     std::string(field.name), otherwise)
                                : otherwise;
  });
  return info;
}

/// Calls visit(field, place) for each field that the group of a formulation has, with the group in
/// which it lies.
template <class P, class Visitor>
void for_each_stored_field(const Group& group, const Visitor& visit) {
  const Handle vectors_handle = open_group(group, "vectors");
  const Group vectors{vectors_handle.id(), group.child("vectors")};
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    const Group& place = std::is_same_v<Member, Vector> ? vectors : group;
    if (field.presence == Presence::required || place.has(std::string(field.name))) {
      visit(field, place);
    }
  });
}

template <class P>
P read_fields(const Group& root) {
  const Handle handle = open_group(root, group_name<P>());
  const Group group{handle.id(), root.child(group_name<P>())};
  P problem;
  for_each_stored_field<P>(group,
                           [&]<class Member>(const Field<P, Member>& field, const Group& place) {
                             const std::string name(field.name);
                             if constexpr (std::is_same_v<Member, Matrix>) {
                               problem.*field.member = read_matrix<Matrix>(place, name);
                             } else if constexpr (std::is_same_v<Member, Vector>) {
                               problem.*field.member = read_doubles<Vector>(place, name);
                             } else {
                               problem.*field.member = read_number<Member>(place, name);
                             }
                           });
  problem.info = read_info(group, "");
  return problem;
}

/// Makes mu as long as the matrices say, where that is how long it is in the file.
template <class P>
void require_contacts(P& outline, std::size_t stored) {
  if (static_cast<std::size_t>(contact_count(outline)) != stored) {
    detail::require_size(static_cast<Index>(stored), contact_count(outline), Dim::nc,
                         "/" + group_name<P>() + "/vectors/mu", "entries");
  }
  count_contacts(outline);
}

template <class P>
RawProblem read_raw_fields(const Group& root) {
  const Handle handle = open_group(root, group_name<P>());
  const Group group{handle.id(), root.child(group_name<P>())};
  RawProblem raw;
  P outline;
  std::size_t contacts = 0;
  for_each_stored_field<P>(group,
                           [&]<class Member>(const Field<P, Member>& field, const Group& place) {
                             const std::string name(field.name);
                             if constexpr (std::is_same_v<Member, Matrix>) {
                               RawMatrix a = read_matrix<RawMatrix>(place, name);
                               (outline.*field.member).rows = a.rows;
                               (outline.*field.member).cols = a.cols;
                               raw.members.push_back({field.name, std::move(a)});
                             } else if constexpr (std::is_same_v<Member, Vector>) {
                               auto values = read_doubles<MallocArray<double>>(place, name);
                               if (field.member == &P::mu) contacts = values.size();
                               raw.members.push_back({field.name, std::move(values)});
                             } else {
                               outline.*field.member = read_number<Member>(place, name);
                               raw.members.push_back({field.name, outline.*field.member});
                             }
                           });
  raw.info = read_info(group, absent_text);

  // vectors have the lengths that the matrices give them
  require_contacts(outline, contacts);
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    if constexpr (std::is_same_v<Member, Vector>) {
      std::size_t size = 0;
      for (const auto& [name, value] : raw.members) {
        if (name == field.name) size = std::get<MallocArray<double>>(value).size();
      }
      detail::require_size(static_cast<Index>(size), outline.size(field.rows), field.rows,
                           "/" + group_name<P>() + "/" + field_path(field), "entries");
    }
  });
  return raw;
}

template <class P>
P read_sizes(const Group& root) {
  const Handle handle = open_group(root, group_name<P>());
  const Group group{handle.id(), root.child(group_name<P>())};
  P problem;
  std::size_t contacts = 0;
  for_each_stored_field<P>(
      group, [&]<class Member>(const Field<P, Member>& field, const Group& place) {
        const std::string name(field.name);
        if constexpr (std::is_same_v<Member, Vector>) {
          if (field.member == &P::mu) contacts = open_numbers(place, name, false).size;
        } else if constexpr (std::is_same_v<Member, Matrix>) {
          const Handle matrix = open_group(place, name);
          problem.*field.member = read_matrix_outline<Matrix>({matrix.id(), place.child(name)});
        } else {
          problem.*field.member = read_number<Member>(place, name);
        }
      });
  require_contacts(problem, contacts);
  return problem;
}

Solution read_solution_group(const Group& parent, const std::string& name) {
  const Handle handle = open_group(parent, name);
  const Group group{handle.id(), parent.child(name)};
  Solution solution;
  for_each_field<Solution>([&](const auto& field) {
    const std::string member(field.name);
    if (field.presence == Presence::required || group.has(member)) {
      solution.*field.member = read_doubles<Vector>(group, member);
    }
  });
  return solution;
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
  Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!file.ok()) {
    fail("", H5Fis_hdf5(path.c_str()) > 0
                 ? "cannot be opened by HDF5 (the file is damaged or cut short)"
                 : "is not an HDF5 file");
  }
  return file;
}

std::vector<std::string> kinds_of(const Group& root) {
  std::vector<std::string> kinds;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if (root.has(group_name<P>())) kinds.emplace_back(P::kind);
  });
  return kinds;
}

Contents contents_of(const Group& root) {
  Contents contents;
  contents.kinds = kinds_of(root);
  contents.solution = root.has("solution");
  if (root.has("guesses")) {
    const Handle handle = open_group(root, "guesses");
    const Group guesses{handle.id(), "/guesses"};
    contents.guesses = read_number<Index>(guesses, "number_of_guesses");
    if (contents.guesses < 0) fail(guesses.child("number_of_guesses"), "is negative");
  }
  return contents;
}

/// The kind of the problem that a solution of the file belongs to.
std::string owner_of(const std::vector<std::string>& kinds, std::string_view preferred = "global") {
  if (kinds.empty()) fail("/", "holds no problem in a known FCLIB layout; it must come first");
  const bool found = std::find(kinds.begin(), kinds.end(), preferred) != kinds.end();
  return found ? std::string(preferred) : kinds.front();
}

Problem outline_of(const Group& root) {
  const std::string owner = owner_of(kinds_of(root));
  Problem problem;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if (owner == P::kind) problem = read_sizes<P>(root);
  });
  return problem;
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
constexpr std::size_t chunked_from = 64;
/// What a reader's cache of one dataset holds, by HDF5's default.
constexpr std::size_t chunk_bytes = std::size_t{1} << 20;
/// What the index of a dataset in chunks takes, in bytes.
constexpr std::size_t index_bytes = 254;
/// What filters are tried on.
constexpr std::size_t sample_entries = std::size_t{1} << 16;
/// Datasets up to this many bytes lie in their own header.
constexpr std::size_t compact_bytes = 4096;
/// Groups of up to this many members keep them in their own header: all of ours do.
constexpr unsigned compact_links = 32;
/// Entries under a node of an index, halved: few datasets have more than one chunk. With 1 an index
/// gets a level for each entry, and HDF5 fails, or ends its process, beyond 255.
constexpr unsigned index_rank = 2;

void check(herr_t status, const std::string& where) {
  if (status < 0) fail(where, "cannot be written by HDF5");
}

/// A group to write into, and how.
struct Target : Group {
  int compression = 0;
  hid_t scratch = -1;  ///< a group of another file, to try things in
};

/// What makes small groups small, for the properties of a group or of a file.
void keep_small(hid_t properties) {
  check(H5Pset_link_phase_change(properties, compact_links, compact_links), "");
  check(H5Pset_est_link_info(properties, 4, 6), "");
  check(H5Pset_obj_track_times(properties, false), "");  // the same problem gives the same bytes
}

Handle create_group(const Group& parent, const std::string& name) {
  const Handle properties(H5Pcreate(H5P_GROUP_CREATE), H5Pclose);
  keep_small(properties.id());
  Handle group(H5Gcreate2(parent.id, name.c_str(), H5P_DEFAULT, properties.id(), H5P_DEFAULT),
               H5Gclose);
  if (!group.ok()) fail(parent.child(name), "cannot be created");
  return group;
}

/// The ways to store an array.
enum class Filter { none, deflate, shuffle_and_deflate };

/// An array to write, and its types in the file and in memory.
struct Array {
  hid_t stored;
  hid_t memory;
  const void* data;
  std::size_t size;

  [[nodiscard]] std::size_t bytes() const { return size * H5Tget_size(stored); }
};

Handle create_array(hid_t group, const std::string& name, const Array& array, Filter filter,
                    int compression) {
  const hsize_t extent = array.size;
  const Handle space(H5Screate_simple(1, &extent, nullptr), H5Sclose);
  const Handle layout(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_obj_track_times(layout.id(), false);
#if H5_VERSION_GE(1, 10, 5)
  H5Pset_dset_no_attrs_hint(layout.id(), true);
#endif
  if (filter != Filter::none) {
    const hsize_t chunk = std::min(array.size, chunk_bytes / H5Tget_size(array.stored));
    H5Pset_chunk(layout.id(), 1, &chunk);
    if (filter == Filter::shuffle_and_deflate) H5Pset_shuffle(layout.id());
    H5Pset_deflate(layout.id(), static_cast<unsigned>(compression));
  } else if (array.bytes() <= compact_bytes) {
    H5Pset_layout(layout.id(), H5D_COMPACT);
  }
  Handle dataset(H5Dcreate2(group, name.c_str(), array.stored, space.id(), H5P_DEFAULT, layout.id(),
                            H5P_DEFAULT),
                 H5Dclose);
  if (!dataset.ok()) fail(name, "cannot be created");
  if (array.size > 0) {
    check(H5Dwrite(dataset.id(), array.memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, array.data), name);
  }
  return dataset;
}

/// The filter that makes an array smallest, found by trying them on its beginning. Shuffling
/// gathers the bytes that numbers of one size share, but hides numbers that come again.
Filter best_filter(const Target& group, const Array& array) {
  if (array.size < chunked_from || group.compression == 0) return Filter::none;
  Array sample = array;
  sample.size = std::min(array.size, sample_entries);
  Filter best = Filter::none;
  std::size_t least = sample.bytes();
  for (const Filter filter : {Filter::shuffle_and_deflate, Filter::deflate}) {
    std::size_t size = index_bytes;
    {
      const Handle trial = create_array(group.scratch, "trial", sample, filter, group.compression);
      check(H5Dflush(trial.id()), "");
      size += H5Dget_storage_size(trial.id());
    }
    check(H5Ldelete(group.scratch, "trial", H5P_DEFAULT), "");
    if (size < least) {
      best = filter;
      least = size;
    }
  }
  return best;
}

void write_array(const Target& group, const std::string& name, const Array& array) {
  create_array(group.id, name, array, best_filter(group, array), group.compression);
}

void write_numbers(const Target& group, const std::string& name, const std::vector<Index>& values) {
  write_array(group, name, {H5T_STD_I32LE, H5T_NATIVE_INT32, values.data(), values.size()});
}
void write_numbers(const Target& group, const std::string& name,
                   const std::vector<double>& values) {
  write_array(group, name, {H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values.data(), values.size()});
}
void write_number(const Target& group, const std::string& name, Index value) {
  write_numbers(group, name, std::vector<Index>{value});
}
void write_number(const Target& group, const std::string& name, double value) {
  write_numbers(group, name, std::vector<double>{value});
}
void write_vector(const Target& group, const std::string& name, const Vector& values) {
  write_array(
      group, name,
      {H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values.data(), static_cast<std::size_t>(values.size())});
}

Handle text_type(const std::string& text) {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.id(), text.size() + 1);
  return type;
}

void write_text(const Group& group, const std::string& name, const std::string& text) {
  if (text == absent_text) return;
  const Handle type = text_type(text);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle layout(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_obj_track_times(layout.id(), false);
#if H5_VERSION_GE(1, 10, 5)
  H5Pset_dset_no_attrs_hint(layout.id(), true);
#endif
  if (text.size() < compact_bytes) H5Pset_layout(layout.id(), H5D_COMPACT);
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

/// A new group inside another, written alike.
class NewGroup {
 public:
  NewGroup(const Target& parent, const std::string& name)
      : handle_(create_group(parent, name)),
        target_{{handle_.id(), parent.child(name)}, parent.compression, parent.scratch} {}
  [[nodiscard]] const Target& target() const { return target_; }

 private:
  Handle handle_;
  Target target_;
};

void write_matrix(const Target& parent, const std::string& name, const Matrix& a) {
  const NewGroup created(parent, name);
  const Target& group = created.target();
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
void write_fields(const Target& root, const P& problem, bool as_given) {
  const NewGroup created(root, group_name<P>());
  const Target& group = created.target();
  const NewGroup vectors(group, "vectors");
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    const std::string name(field.name);
    if (field.presence == Presence::mixed && !is_mixed(problem)) return;
    if constexpr (std::is_same_v<Member, Matrix>) {
      const Matrix& a = problem.*field.member;
      // read from a file without it
      if (field.presence != Presence::required && as_given && a.empty() && a.p.empty()) return;
      const bool convert = P::triplets_on_disk && !as_given;
      write_matrix(group, name, convert ? converted(a, Storage::triplet) : a);
    } else if constexpr (std::is_same_v<Member, Vector>) {
      write_vector(vectors.target(), name, problem.*field.member);
    } else {
      write_number(group, name, problem.*field.member);
    }
  });
  bool informed = false;
  for_each_field<ProblemInfo>(
      [&](const auto& field) { informed = informed || problem.info.*field.member != absent_text; });
  if (!informed) return;
  const NewGroup info(group, "info");
  for_each_field<ProblemInfo>([&](const auto& field) {
    write_text(info.target(), std::string(field.name), problem.info.*field.member);
  });
}

void write_solution_group(const Target& parent, const std::string& name, const Solution& solution) {
  const NewGroup group(parent, name);
  for_each_field<Solution>([&](const auto& field) {
    const Vector& values = solution.*field.member;
    if (field.presence != Presence::required && values.size() == 0) return;
    write_vector(group.target(), std::string(field.name), values);
  });
}

/// Makes room for what is to be written: where something is there already, it goes, or that is an
/// error.
void make_room(const Group& root, const std::string& name, bool replace) {
  if (!root.has(name)) return;
  if (!replace) fail(root.child(name), "is in the file already, and is not to be replaced");
  check(H5Ldelete(root.id, name.c_str(), H5P_DEFAULT), root.child(name));
}

/// Makes those who read a file, change it and put it back take turns. The lock is on the folder,
/// since the file itself is replaced; it goes with the process that holds it. Where the file system
/// has no such locks there is none.
class Turn {
 public:
  explicit Turn(const std::string& path) {
    const fs::path folder = fs::path(resolve_links(path)).parent_path();
    folder_ = ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    while (folder_ >= 0 && ::flock(folder_, LOCK_EX) != 0 && errno == EINTR) {
    }
  }
  ~Turn() {
    if (folder_ >= 0) ::close(folder_);
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

 private:
  int folder_ = -1;
};

/// What HDF5 leaves of a file in memory when it closes it: the file, and room beyond its end.
class Image {
 public:
  Image() = default;
  ~Image() { std::free(memory_); }
  Image(const Image&) = delete;
  Image& operator=(const Image&) = delete;

  [[nodiscard]] const char* data() const { return static_cast<const char*>(memory_); }

  /// Has HDF5 hand over the memory of a file that is opened with these properties.
  void catch_from(hid_t access) {
    H5FD_file_image_callbacks_t callbacks{};
    callbacks.image_malloc = [](std::size_t size, H5FD_file_image_op_t, void*) {
      return std::malloc(size);
    };
    callbacks.image_realloc = [](void* memory, std::size_t size, H5FD_file_image_op_t, void*) {
      return std::realloc(memory, size);
    };
    callbacks.image_free = [](void* memory, H5FD_file_image_op_t operation, void* self) -> herr_t {
      if (operation == H5FD_FILE_IMAGE_OP_FILE_CLOSE) {
        static_cast<Image*>(self)->memory_ = memory;
      } else {
        std::free(memory);
      }
      return 0;
    };
    callbacks.udata_copy = [](void* self) { return self; };
    callbacks.udata_free = [](void*) -> herr_t { return 0; };
    callbacks.udata = this;
    check(H5Pset_file_image_callbacks(access, &callbacks), "");
  }

 private:
  void* memory_ = nullptr;
};

/// An HDF5 file in memory. HDF5 never writes to a disk itself: what fails there (a full disk) it
/// does not survive in good order.
class MemoryFile {
 public:
  /// An empty file; two that are open at once need two names.
  explicit MemoryFile(const char* name = "new")
      : access_(core_driver(image_)), file_(create(name, access_.id())) {}
  /// The file that these bytes are.
  explicit MemoryFile(const std::vector<char>& bytes)
      : access_(core_driver(image_)), file_(open(access_.id(), bytes)) {}

  [[nodiscard]] hid_t id() const { return file_->id(); }

  /// Closes the file: what it has become.
  [[nodiscard]] std::string_view finish() {
    check(H5Fflush(file_->id(), H5F_SCOPE_LOCAL), "");
    const ssize_t size = H5Fget_file_image(file_->id(), nullptr, 0);
    file_.reset();
    if (size <= 0 || image_.data() == nullptr) fail("", "cannot be put together by HDF5");
    return {image_.data(), static_cast<std::size_t>(size)};
  }

 private:
  static Handle core_driver(Image& image) {
    constexpr std::size_t increment = std::size_t{1} << 20;
    Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    check(H5Pset_fapl_core(access.id(), increment, false), "");
    image.catch_from(access.id());
    // no room kept for what never comes
    check(H5Pset_meta_block_size(access.id(), 0), "");
    check(H5Pset_small_data_block_size(access.id(), 0), "");
    return access;
  }
  static Handle create(const char* name, hid_t access) {
    const Handle properties(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
    keep_small(properties.id());
    check(H5Pset_istore_k(properties.id(), index_rank), "");
    check(H5Pset_sym_k(properties.id(), index_rank, 1), "");
    check(H5Pset_local_heap_size_hint(properties.id(), 64), "");
    Handle file(H5Fcreate(name, H5F_ACC_TRUNC, properties.id(), access), H5Fclose);
    if (!file.ok()) fail("", "cannot be created by HDF5");
    use_small_headers(file.id());
    return file;
  }
  static Handle open(hid_t access, const std::vector<char>& bytes) {
    std::vector<char> copy = bytes;
    check(H5Pset_file_image(access, copy.data(), copy.size()), "");
    Handle file(H5Fopen("image", H5F_ACC_RDWR, access), H5Fclose);
    if (!file.ok()) fail("", "cannot be opened by HDF5 (the file is damaged or cut short)");
    use_small_headers(file.id());
    return file;
  }
  /// From here on the headers of HDF5 1.8, which take less than the older ones. A file created with
  /// them would carry the time of its making.
  static void use_small_headers(hid_t file) {
    check(H5Fset_libver_bounds(file, H5F_LIBVER_V18, H5F_LIBVER_LATEST), "");
  }

  Image image_;  // outlives the file, which is closed into it
  Handle access_;
  std::optional<Handle> file_;
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

namespace {

/// The kind of problem to read: the one asked for, or the only one there is.
std::string kind_to_read(const Group& root, std::string_view asked) {
  const std::string name(asked);
  bool found = false;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    found = found || (asked == P::kind && root.has(group_name<P>()));
  });
  if (found) return name;
  const std::vector<std::string> kinds = kinds_of(root);
  std::string known;
  for (const auto& other : kinds) known += (known.empty() ? "" : ", ") + other;
  if (!asked.empty()) {
    fail("/", "holds no " + name + " problem" + (known.empty() ? "" : "; it holds: " + known));
  }
  if (kinds.empty()) fail("/", "holds no problem in a known FCLIB layout");
  if (kinds.size() > 1) fail("/", "holds several problems, name one of: " + known);
  return kinds.front();
}

}  // namespace

Problem read_problem(const std::string& path, std::string_view kind) {
  const Session session;
  return in_file(path, [&] {
    const Handle file = open_file(path);
    const Group root{file.id(), "/"};
    const std::string wanted = kind_to_read(root, kind);
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

RawProblem read_raw_problem(const std::string& path, std::string_view kind) {
  const Session session;
  return in_file(path, [&] {
    const Handle file = open_file(path);
    const Group root{file.id(), "/"};
    const std::string wanted = kind_to_read(root, kind);
    RawProblem problem;
    for_each_formulation([&]<class P>(std::type_identity<P>) {
      if (wanted == P::kind) problem = read_raw_fields<P>(root);
    });
    return problem;
  });
}

Problem read_outline(const std::string& path) {
  const Session session;
  return in_file(path, [&] {
    const Handle file = open_file(path);
    return outline_of({file.id(), "/"});
  });
}

std::optional<Solution> read_solution(const std::string& path) {
  const Session session;
  return in_file(path, [&]() -> std::optional<Solution> {
    const Handle file = open_file(path);
    const Group root{file.id(), "/"};
    if (!root.has("solution")) return std::nullopt;
    return read_solution_group(root, "solution");
  });
}

std::vector<Solution> read_guesses(const std::string& path) {
  const Session session;
  return in_file(path, [&] {
    const Handle file = open_file(path);
    const Group root{file.id(), "/"};
    std::vector<Solution> guesses;
    const Index count = contents_of(root).guesses;
    if (count == 0) return guesses;
    const Handle handle = open_group(root, "guesses");
    const Group group{handle.id(), root.child("guesses")};
    for (Index k = 1; k <= count; ++k) {
      guesses.push_back(read_solution_group(group, std::to_string(k)));
    }
    return guesses;
  });
}

namespace {

void require_level(int compression) {
  if (compression < 0 || compression > 9) {
    throw Error(ErrorKind::option, "is " + std::to_string(compression) + ", but must be 0 to 9",
                "the compression level");
  }
}

/// What a change starts from.
enum class Start { existing, empty, existing_or_empty };

/// Changes a file: change(root) writes into a copy, which then takes the place of the file.
template <class Change>
void change_file(const std::string& path, Start start, const WriteOptions& options,
                 const Change& change) {
  require_level(options.compression);
  const Session session;
  in_file(path, [&] {
    const Turn turn(path);
    std::error_code error;
    const bool existing =
        start == Start::existing || (start == Start::existing_or_empty && fs::exists(path, error));
    if (existing) const Handle checked = open_file(path);  // says best what is wrong with it
    MemoryFile file = existing ? MemoryFile(read_bytes(path)) : MemoryFile();
    const MemoryFile scratch("scratch");
    const Target root{{file.id(), "/"}, options.compression, scratch.id()};
    if (!existing) {
      write_text_attribute(root, "format", format_version);
      write_text_attribute(root, "generator", "fclib " + std::string(version));
    }
    change(root);
    replace_file(path, file.finish());
  });
}

}  // namespace

namespace {

/// Guesses number `first` and the following ones of a file.
void write_guesses_from(const Target& guesses, std::size_t first,
                        const std::vector<Solution>& values) {
  for (std::size_t k = 0; k < values.size(); ++k) {
    write_solution_group(guesses, std::to_string(first + k), values[k]);
  }
  write_number(guesses, "number_of_guesses", static_cast<Index>(first - 1 + values.size()));
}

/// Throws where a problem that was added is the one that a solution or a guess now belongs to,
/// though it was written for another; or where it is not, though they are its own.
void require_owner(const Group& root, const std::string& kind, bool owned_before, bool brings) {
  const bool others = root.has("solution") || root.has("guesses");
  const bool owner = owner_of(kinds_of(root)) == kind;
  if (!owned_before && owner && others) {
    fail("/",
         "the solution and the guesses in the file would become those of the " + kind + " problem");
  }
  if (brings && !owner) {
    fail("/", "a solution or a guess in the file belongs to its " + owner_of(kinds_of(root)) +
                  " problem, not to the " + kind + " one");
  }
}

}  // namespace

void write_file(const std::string& path, ProblemPointer problem, const Solution* solution,
                const std::vector<Solution>& guesses, const WriteOptions& options) {
  if (options.validate) {
    in_file(path, [&] {
      std::visit(
          [&](const auto* p) {
            validate(*p);
            if (solution != nullptr) validate(*solution, *p);
            for (std::size_t k = 0; k < guesses.size(); ++k) {
              validate(guesses[k], *p, guess_path(k + 1));
            }
          },
          problem);
    });
  }
  const Start start = options.append ? Start::existing_or_empty : Start::empty;
  change_file(path, start, options, [&](const Target& root) {
    const std::string kind =
        std::visit([]<class P>(const P*) { return std::string(P::kind); }, problem);
    const std::string group = "fclib_" + kind;
    const std::vector<std::string> before = kinds_of(root);
    const bool owned = before.empty() || owner_of(before) == kind;
    if (root.has(group)) {
      make_room(root, group, options.replace);
      // those of another problem stay
      if (owned) make_room(root, "solution", options.replace);
      if (owned) make_room(root, "guesses", options.replace);
    }
    std::visit([&](const auto* p) { write_fields(root, *p, !options.validate); }, problem);
    if (options.validate) {
      require_owner(root, kind, owned, solution != nullptr || !guesses.empty());
    }
    if (solution != nullptr) {
      make_room(root, "solution", options.replace);
      write_solution_group(root, "solution", *solution);
    }
    if (!guesses.empty()) {
      make_room(root, "guesses", options.replace);
      write_guesses_from(NewGroup(root, "guesses").target(), 1, guesses);
    }
  });
}

void write_solution(const std::string& path, const Solution& solution,
                    const WriteOptions& options) {
  change_file(path, Start::existing, options, [&](const Target& root) {
    if (options.validate) {
      std::visit([&](const auto& p) { validate(solution, p); }, outline_of(root));
    }
    make_room(root, "solution", options.replace);
    write_solution_group(root, "solution", solution);
  });
}

void write_guesses(const std::string& path, const std::vector<Solution>& guesses,
                   const WriteOptions& options) {
  change_file(path, Start::existing, options, [&](const Target& root) {
    if (options.validate) {
      const Problem outline = outline_of(root);
      for (std::size_t k = 0; k < guesses.size(); ++k) {
        std::visit([&](const auto& p) { validate(guesses[k], p, guess_path(k + 1)); }, outline);
      }
    }
    const Index there = options.append ? contents_of(root).guesses : 0;
    if (there > 0) {
      const Handle group = open_group(root, "guesses");
      const Target target{{group.id(), root.child("guesses")}, root.compression, root.scratch};
      make_room(target, "number_of_guesses", true);
      write_guesses_from(target, static_cast<std::size_t>(there) + 1, guesses);
      return;
    }
    // an empty group is no reason to refuse
    make_room(root, "guesses", options.replace || options.append);
    write_guesses_from(NewGroup(root, "guesses").target(), 1, guesses);
  });
}

namespace {

/// The path of a group that has attributes, by its short name.
std::string group_with_attributes(const Group& root, std::string_view name) {
  if (name == "solution") return "solution";
  if (name == "info") return "fclib_" + owner_of(kinds_of(root)) + "/info";
  throw Error(ErrorKind::option,
              "there is no group '" + std::string(name) + "'; there are: solution, info", "group");
}

herr_t add_name(hid_t, const char* name, const H5A_info_t*, void* names) {
  static_cast<std::vector<std::string>*>(names)->emplace_back(name);
  return 0;
}

/// An attribute that is one number or one text of fixed length, or nothing.
std::optional<std::variant<double, std::string>> read_attribute(hid_t group,
                                                                const std::string& name) {
  const Handle attribute(H5Aopen(group, name.c_str(), H5P_DEFAULT), H5Aclose);
  if (!attribute.ok()) return std::nullopt;
  const Handle space(H5Aget_space(attribute.id()), H5Sclose);
  const Handle type(H5Aget_type(attribute.id()), H5Tclose);
  if (H5Sget_simple_extent_npoints(space.id()) != 1) return std::nullopt;
  const H5T_class_t kind = H5Tget_class(type.id());
  if (kind == H5T_INTEGER || kind == H5T_FLOAT) {
    double value = 0;
    if (H5Aread(attribute.id(), H5T_NATIVE_DOUBLE, &value) < 0) return std::nullopt;
    return value;
  }
  // attributes lie in the header of their group, which ends at 64 kB
  constexpr std::size_t longest = std::size_t{1} << 16;
  const std::size_t size = H5Tget_size(type.id());
  if (kind != H5T_STRING || H5Tis_variable_str(type.id()) > 0 || size > longest) {
    return std::nullopt;
  }
  std::string text(size, '\0');
  if (H5Aread(attribute.id(), type.id(), text.data()) < 0) return std::nullopt;
  return text.substr(0, text.find('\0'));
}

}  // namespace

Attributes read_attributes(const std::string& path, std::string_view group) {
  const Session session;
  return in_file(path, [&] {
    const Handle file = open_file(path);
    const Group root{file.id(), "/"};
    const std::string name = group_with_attributes(root, group);
    Attributes result;
    const std::string parent = name.substr(0, name.find('/'));
    if (!root.has(parent) || !root.has(name)) return result;
    const Handle handle = open_group(root, name);
    std::vector<std::string> names;
    H5Aiterate2(handle.id(), H5_INDEX_NAME, H5_ITER_INC, nullptr, add_name, &names);
    for (const std::string& key : names) {
      if (const auto value = read_attribute(handle.id(), key)) result[key] = *value;
    }
    return result;
  });
}

void write_attributes(const std::string& path, std::string_view group,
                      const Attributes& attributes) {
  change_file(path, Start::existing, {}, [&](const Target& root) {
    const std::string name = group_with_attributes(root, group);
    const std::string parent = name.substr(0, name.find('/'));
    const bool there = root.has(parent) && root.has(name);
    const Handle handle =
        there || group == "solution" ? open_group(root, name) : create_group(root, name);
    const Group target{handle.id(), root.child(name)};
    for (const auto& [key, value] : attributes) {
      const std::string where = target.path + ", attribute " + key;
      if (H5Aexists(handle.id(), key.c_str()) > 0)
        check(H5Adelete(handle.id(), key.c_str()), where);
      if (const auto* text = std::get_if<std::string>(&value)) {
        write_text_attribute(target, key.c_str(), *text);
        continue;
      }
      const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
      const Handle attribute(H5Acreate2(handle.id(), key.c_str(), H5T_IEEE_F64LE, space.id(),
                                        H5P_DEFAULT, H5P_DEFAULT),
                             H5Aclose);
      if (!attribute.ok()) fail(where, "cannot be created");
      check(H5Awrite(attribute.id(), H5T_NATIVE_DOUBLE, &std::get<double>(value)), where);
    }
  });
}

void write_int_attribute(const std::string& path, const std::string& name, Index value,
                         const WriteOptions& options) {
  change_file(path, Start::existing, options, [&](const Target& root) {
    const std::string problem = "fclib_" + owner_of(kinds_of(root), "local");
    const Handle parent = open_group(root, problem);
    const Group group{parent.id(), root.child(problem)};
    const Handle handle =
        group.has("info") ? open_group(group, "info") : create_group(group, "info");
    const std::string where = group.child("info") + ", attribute " + name;
    if (H5Aexists(handle.id(), name.c_str()) > 0) {
      if (!options.replace) fail(where, "is in the file already, and is not to be replaced");
      check(H5Adelete(handle.id(), name.c_str()), where);
    }
    const hsize_t extent = 1;
    const Handle space(H5Screate_simple(1, &extent, nullptr), H5Sclose);
    const Handle attribute(
        H5Acreate2(handle.id(), name.c_str(), H5T_STD_I32LE, space.id(), H5P_DEFAULT, H5P_DEFAULT),
        H5Aclose);
    if (!attribute.ok()) fail(where, "cannot be created");
    check(H5Awrite(attribute.id(), H5T_NATIVE_INT32, &value), where);
  });
}

}  // namespace fclib
