#include "io/hdf5/sequence.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <mutex>
#include <span>
#include <utility>

#include "io/crc32.hpp"
#include "io/hdf5/contents.hpp"
#include "io/hdf5/geometry_groups.hpp"
#include "io/hdf5/open.hpp"
#include "io/hdf5/transaction.hpp"
#include "io/hdf5/write_objects.hpp"
#include "io/replace_file.hpp"
#include "version.hpp"

namespace fclib {

using namespace hdf5;

namespace {

namespace fs = std::filesystem;

/// The bytes of a chunk. Each flush writes the last chunk of a dataset anew, and each dataset has
/// one that is not full.
constexpr std::size_t chunk_bytes = std::size_t{1} << 14;
/// After so many bytes, or so long after the last flush, a step is confirmed without being asked
/// for: a flush takes as long as many steps.
constexpr std::size_t most_pending = std::size_t{1} << 20;
constexpr std::chrono::milliseconds longest_pending(100);

/// The file of a sequence that others may read meanwhile. Only the format of HDF5 1.10 has that.
Handle access_of_sequence() {
  Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_libver_bounds(access.id(), H5F_LIBVER_V110, H5F_LIBVER_V110);
  return access;
}

/// The bytes of one entry of a dataset.
struct Layout {
  const char* name;
  Handle stored;
  Handle memory;
};

/// The datasets of a sequence in the order in which they are flushed: each refers to those before.
enum class Part { names, texts, integers, numbers, entries, steps };
constexpr std::size_t part_count = 6;

Layout layout_of(Part part) {
  const auto same = [](hid_t type) { return Handle(H5Tcopy(type), H5Tclose); };
  switch (part) {
    case Part::names:
      return {"names", same(H5T_STD_U8LE), same(H5T_NATIVE_UINT8)};
    case Part::texts:
      return {"texts", same(H5T_STD_U8LE), same(H5T_NATIVE_UINT8)};
    case Part::integers:
      return {"integers", same(H5T_STD_I32LE), same(H5T_NATIVE_INT32)};
    case Part::numbers:
      return {"numbers", same(H5T_IEEE_F64LE), same(H5T_NATIVE_DOUBLE)};
    case Part::entries:
      return {"entries", type_of_entry(Side::file), type_of_entry(Side::memory)};
    case Part::steps:
      break;
  }
  return {"steps", type_of_step(Side::file), type_of_step(Side::memory)};
}

Part part_of(Pool pool) {
  return pool == Pool::numbers ? Part::numbers
                               : (pool == Pool::integers ? Part::integers : Part::texts);
}

void create_parts(const Group& root, int compression) {
  const Style style(compression, {});
  const Target target{root, &style};
  const NewGroup group(target, sequence_group);
  const hsize_t none = 0;
  const hsize_t any = H5S_UNLIMITED;
  const Handle space(H5Screate_simple(1, &none, &any), H5Sclose);
  for (std::size_t k = 0; k < part_count; ++k) {
    const Layout layout = layout_of(static_cast<Part>(k));
    const Handle properties(H5Pcopy(compression > 0 ? style.shuffled.id() : style.plain.id()),
                            H5Pclose);
    const hsize_t chunk = chunk_bytes / H5Tget_size(layout.stored.id());
    H5Pset_chunk(properties.id(), 1, &chunk);
    const Handle dataset(H5Dcreate2(group.target().id, layout.name, layout.stored.id(), space.id(),
                                    H5P_DEFAULT, properties.id(), H5P_DEFAULT),
                         H5Dclose);
    if (!dataset.ok()) fail(group.target().child(layout.name), "cannot be created");
  }
}

/// Puts a new sequence in the place of a file: fill(root) makes its content. A process that is
/// killed meanwhile leaves the old file, and the new one beside it.
template <class Fill>
void replace_sequence(const std::string& path, const Fill& fill) {
  const std::string beside = name_beside(path);
  try {
    {
      const Handle access = access_of_sequence();
      const Handle file(H5Fcreate(beside.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.id()),
                        H5Fclose);
      if (!file.ok()) {
        fail("", "cannot be written: " + std::string(std::strerror(errno)));
      }
      const Group root{file.id(), "/"};
      write_text_attribute(root, "format", "FCLIB sequence 1");
      write_text_attribute(root, "generator", "fclib " + std::string(version));
      fill(root);
      check(H5Fflush(file.id(), H5F_SCOPE_GLOBAL), "");
    }
    fs::rename(beside, path);
  } catch (...) {
    std::error_code unknown;
    fs::remove(beside, unknown);
    throw;
  }
}

bool is_sequence(const std::string& path) {
  const Handle file = open_file(path);
  return Group{file.id(), "/"}.has(sequence_group);
}

bool was_closed(const std::string& path) {
  return Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose).ok();
}

/// Puts a copy in the place of a sequence whose writer was killed. Where its next byte goes is not
/// known, and HDF5 does not let anybody write to it.
void restore(const std::string& path) {
  const Handle from = open_file(path);
  replace_sequence(path, [&](const Group& root) {
    check(H5Ocopy(from.id(), sequence_group, root.id, sequence_group, H5P_DEFAULT, H5P_DEFAULT),
          "");
  });
}

/// A dataset at the end of which entries are put.
class Growing {
 public:
  Growing(const Group& group, Part part)
      : layout_(layout_of(part)),
        path_(group.child(layout_.name)),
        width_(H5Tget_size(layout_.memory.id())),
        dataset_(H5Dopen2(group.id, layout_.name, H5P_DEFAULT), H5Dclose) {
    if (!dataset_.ok()) fail(path_, "is not a dataset that HDF5 can open");
    const Handle space(H5Dget_space(dataset_.id()), H5Sclose);
    if (H5Sget_simple_extent_dims(space.id(), &written_, nullptr) != 1) {
      fail(path_, "does not have one dimension");
    }
  }

  /// Where the next entry goes.
  [[nodiscard]] std::size_t size() const {
    return static_cast<std::size_t>(written_) + pending_.size() / width_;
  }
  [[nodiscard]] std::size_t pending() const { return pending_.size(); }

  void put(std::span<const char> bytes) {
    pending_.insert(pending_.end(), bytes.begin(), bytes.end());
  }

  /// Drops what is stored beyond so many entries.
  void cut(std::size_t size) {
    written_ = size;
    check(H5Dset_extent(dataset_.id(), &written_), path_);
  }

  void flush() {
    if (pending_.empty()) return;
    const hsize_t count = pending_.size() / width_;
    const hsize_t end = written_ + count;
    check(H5Dset_extent(dataset_.id(), &end), path_);
    const Handle space(H5Dget_space(dataset_.id()), H5Sclose);
    const Handle room(H5Screate_simple(1, &count, nullptr), H5Sclose);
    check(H5Sselect_hyperslab(space.id(), H5S_SELECT_SET, &written_, nullptr, &count, nullptr),
          path_);
    check(H5Dwrite(dataset_.id(), layout_.memory.id(), room.id(), space.id(), H5P_DEFAULT,
                   pending_.data()),
          path_);
    check(H5Dflush(dataset_.id()), path_);
    written_ = end;
    pending_.clear();
  }

 private:
  Layout layout_;
  std::string path_;
  std::size_t width_;
  Handle dataset_;
  hsize_t written_ = 0;
  std::vector<char> pending_;
};

std::string group_of(const ProblemView& problem) { return "fclib_" + problem.kind + "/"; }

template <class Values>
std::span<const char> bytes_of(const Values& values) {
  return {reinterpret_cast<const char*>(values.data()),
          static_cast<std::size_t>(values.size()) * sizeof *values.data()};
}

}  // namespace

class SequenceWriter::File {
 public:
  File(const std::string& path, const SequenceOptions& options) : path_(resolve_links(path)) {
    require_level(options.compression);
    const Session session;
    in_file(path_, [&] {
      std::error_code unknown;
      const bool there = fs::exists(path_, unknown);
      if (there) lock_ = std::make_unique<WriterLock>(path_);
      if (!there || !options.append) {
        replace_sequence(path_,
                         [&](const Group& root) { create_parts(root, options.compression); });
        lock_ = std::make_unique<WriterLock>(path_);
      } else if (!is_sequence(path_)) {
        fail("/", "is no sequence, and is not to be replaced");
      } else if (!was_closed(path_)) {
        restore(path_);
        lock_ = std::make_unique<WriterLock>(path_);
      }
      open();
      if (there && options.append) go_on();
    });
  }

  ~File() {
    const Session session;
    parts_.clear();
    file_.reset();
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  /// Runs a change of the writer. After a failed write nothing more is written: what HDF5 then has
  /// is not known.
  template <class Body>
  auto locked(const Body& body) {
    const std::lock_guard lock(mutex_);
    return in_file(path_, [&] {
      if (!file_) fail("", "is closed");
      if (failed_) fail("", "cannot be written: an earlier write failed");
      return body();
    });
  }

  [[nodiscard]] std::size_t size() const { return part(Part::steps).size() + (step_ ? 1 : 0); }

  /// Begins a step with its problem. After an error there is no step.
  void begin(const ProblemView& problem, Index world) {
    locked([&] {
      end_step();
      if (world < 0) {
        throw Error(ErrorKind::option, "is " + std::to_string(world) + ", but must be 0 or more",
                    "world");
      }
      world_ = world;
      all_or_nothing([&] { put_problem(problem); });
      step_ = true;
    });
  }

  /// Adds all that `body` puts to the step, or nothing.
  template <class Body>
  void add_to_step(const Body& body) {
    locked([&] {
      if (!step_) fail("", "no step has begun: its problem comes first");
      all_or_nothing(body);
    });
  }

  template <class Values>
  void put(Pool pool, const std::string& path, const Values& values) {
    put_array({pool, path}, static_cast<std::size_t>(values.size()), bytes_of(values),
              [&] { return crc32_of(values); });
  }
  void put_number(const std::string& path, Index value) {
    put(Pool::integers, path, std::array<Index, 1>{value});
  }
  void put_text(const std::string& path, const std::string& text) { put(Pool::texts, path, text); }

  void put_matrix(const std::string& group, const RawMatrixView& a) {
    put_number(group + "m", a.rows);
    put_number(group + "n", a.cols);
    put_number(group + "nz", a.nz());
    if (a.storage != Storage::dense) {
      put(Pool::integers, group + "p", a.p);
      put(Pool::integers, group + "i", a.i);
    }
    put(Pool::numbers, group + "x", a.x);
    if (!a.info) return;
    for_each_field<MatrixInfo>([&]<class Member>(const Field<MatrixInfo, Member>& field) {
      const std::string path = group + std::string(field.name);
      const Member& value = (*a.info).*field.member;
      if constexpr (std::is_same_v<Member, std::string>) {
        if (is_there(value)) put_text(path, value);
      } else if constexpr (std::is_same_v<Member, double>) {
        put(Pool::numbers, path, std::array<double, 1>{value});
      } else {
        put_number(path, value);
      }
    });
  }
  void put_problem(const ProblemView& problem) {
    const std::string group = group_of(problem);
    for (const ProblemView::Member& member : problem.members) {
      const std::string name = group + std::string(member.name);
      std::visit(
          [&]<class Value>(const Value& value) {
            if constexpr (std::is_same_v<Value, RawMatrixView>) {
              put_matrix(name + "/", value);
            } else if constexpr (std::is_same_v<Value, Index>) {
              put_number(name, value);
            } else {
              put(Pool::numbers, group + "vectors/" + std::string(member.name), value);
            }
          },
          member.value);
    }
    for_each_field<ProblemInfo>([&](const auto& field) {
      const std::string& text = problem.info.*field.member;
      if (is_there(text)) put_text(group + "info/" + std::string(field.name), text);
    });
  }
  void put_solution(const std::string& group, const Solution& solution) {
    for_each_field<Solution>([&](const auto& field) {
      const Vector& values = solution.*field.member;
      if (field.presence != Presence::required && values.size() == 0) return;
      put(Pool::numbers, group + std::string(field.name), values);
    });
  }

  void end_step() {
    if (!step_) return;
    step_ = false;
    part(Part::entries).put(bytes_of(entries_));
    const Index number = numbers_[world_]++;
    const std::array<StepRow, 1> row{StepRow{static_cast<std::int64_t>(part(Part::entries).size()),
                                             world_, number, checksum_.of(world_, number)}};
    part(Part::steps).put(bytes_of(row));
    entries_.clear();
    checksum_ = {};
    std::size_t pending = 0;
    for (const Growing& one : parts_) pending += one.pending();
    const auto now = std::chrono::steady_clock::now();
    if (pending > most_pending || now - flushed_ > longest_pending) flush();
  }

  void flush() {
    end_step();
    const Session session;
    reserve();
    failed_ = true;
    for (Growing& one : parts_) one.flush();
    failed_ = false;
    flushed_ = std::chrono::steady_clock::now();
  }

  void close() {
    flush();
    {
      const Session session;
      parts_.clear();
      file_.reset();
    }
    lock_->finish();
    lock_.reset();
  }

 private:
  template <class Body>
  void all_or_nothing(const Body& body) {
    const std::size_t before = entries_.size();
    const StepChecksum checksum = checksum_;
    try {
      body();
    } catch (...) {
      entries_.resize(before);
      checksum_ = checksum;
      throw;
    }
  }

  /// Makes sure that there is room for all that is pending: after a failed write HDF5 is no longer
  /// in good order, so a full disk must be known before.
  void reserve() {
    // each dataset may begin a chunk, and HDF5 another block of its index
    std::uint64_t needed = part_count * 2 * chunk_bytes;
    for (const Growing& one : parts_) needed += one.pending();
    hsize_t end = 0;
    check(H5Fget_filesize(file_->id(), &end), "");
    if (end + needed <= reserved_) return;
    // much at once, since that is a call of the system; on a disk that is nearly full, what is
    // needed
    for (const std::uint64_t bytes : {needed + most_pending, needed}) {
      reserved_ = end + bytes;
      if (lock_->reserve(end, bytes)) return;
    }
    reserved_ = end;
    lock_->fail_in_system();
  }

  /// The last array of a name, which the next steps may share.
  struct Last {
    Entry entry;
    std::vector<char> bytes;
    std::uint32_t checksum = 0;
  };

  [[nodiscard]] Growing& part(Part which) { return parts_[static_cast<std::size_t>(which)]; }
  [[nodiscard]] const Growing& part(Part which) const {
    return parts_[static_cast<std::size_t>(which)];
  }

  void open() {
    const Handle access = access_of_sequence();
    H5Pset_metadata_read_attempts(access.id(), 1);  // there is no other writer to wait for
    file_.emplace(H5Fopen(path_.c_str(), H5F_ACC_RDWR | H5F_ACC_SWMR_WRITE, access.id()), H5Fclose);
    if (!file_->ok()) {
      file_.reset();
      fail("",
           "cannot be opened to go on with it. If no other program has it open, it was "
           "rewritten in another format of HDF5: copy it with 'fclib convert'");
    }
    const Group root{file_->id(), "/"};
    const Handle handle = open_group(root, sequence_group);
    const Group group{handle.id(), root.child(sequence_group)};
    for (std::size_t k = 0; k < part_count; ++k) parts_.emplace_back(group, static_cast<Part>(k));
  }

  /// What is known of the steps that are there. Their arrays are not shared with the next ones.
  void go_on() {
    const StoredSequence stored({file_->id(), "/"});
    for (const ArrayName& name : stored.names()) {
      names_.emplace(name.line(), static_cast<std::int32_t>(names_.size()));
    }
    std::int64_t end = 0;
    for (const StepRow& row : stored.rows(0, stored.size())) {
      numbers_[row.world] = row.number + 1;
      end = row.end;
    }
    // a killed writer may have left entries of a step that it did not confirm
    if (end >= 0 && static_cast<std::size_t>(end) < part(Part::entries).size()) {
      part(Part::entries).cut(static_cast<std::size_t>(end));
    }
  }

  std::int32_t number_of(const std::string& line) {
    const auto [known, fresh] = names_.emplace(line, static_cast<std::int32_t>(names_.size()));
    if (fresh) {
      part(Part::names).put(line);
      part(Part::names).put(std::string_view("\n"));
    }
    return known->second;
  }

  template <class Checksum>
  void put_array(const ArrayName& array, std::size_t length, std::span<const char> bytes,
                 const Checksum& checksum) {
    const std::string line = array.line();
    const std::int32_t name = number_of(line);
    for (const Entry& entry : entries_) {
      if (entry.name == name) fail("/" + array.path, "was already given to this step");
    }
    if (length > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max())) {
      fail("/" + array.path,
           "has " + std::to_string(length) + " entries, more than can be numbered");
    }
    const auto [known, fresh] = last_.try_emplace({world_, name});
    Last& last = known->second;
    if (fresh || !std::equal(bytes.begin(), bytes.end(), last.bytes.begin(), last.bytes.end())) {
      Growing& target = part(part_of(array.pool));
      const auto start = static_cast<std::int64_t>(target.size());
      target.put(bytes);
      last.bytes.assign(bytes.begin(), bytes.end());
      last.entry = {name, static_cast<std::int32_t>(length), start};
      last.checksum = checksum();
    }
    entries_.push_back(last.entry);
    checksum_.add(line, last.checksum);
  }

  std::string path_;
  std::mutex mutex_;
  std::unique_ptr<WriterLock> lock_;
  std::optional<Handle> file_;
  std::vector<Growing> parts_;
  std::map<std::string, std::int32_t, std::less<>> names_;
  std::map<std::pair<Index, std::int32_t>, Last> last_;
  std::map<Index, Index> numbers_;
  std::vector<Entry> entries_;  // of the step that has begun
  StepChecksum checksum_;       // likewise
  Index world_ = 0;
  bool step_ = false;
  bool failed_ = false;
  std::uint64_t reserved_ = 0;  // the end of the room that was taken
  std::chrono::steady_clock::time_point flushed_ = std::chrono::steady_clock::now();
};

SequenceWriter::SequenceWriter(const std::string& path, const SequenceOptions& options)
    : file_(std::make_unique<File>(path, options)) {}

SequenceWriter::~SequenceWriter() {
  try {
    file_->locked([&] { file_->close(); });
  } catch (...) {
    // close() reports it
  }
}

void SequenceWriter::add(const ProblemView& problem, Index world) {
  file_->begin(problem, world);
  info_ = group_of(problem) + "info";
  if (problem.geometry) add_geometry(*problem.geometry);
}

void SequenceWriter::add_solution(const Solution& solution) {
  file_->add_to_step([&] { file_->put_solution("solution/", solution); });
}

void SequenceWriter::add_guesses(const std::vector<Solution>& guesses) {
  file_->add_to_step([&] {
    const std::string group = std::string(guesses_list.group) + "/";
    for (std::size_t k = 0; k < guesses.size(); ++k) {
      file_->put_solution(group + std::to_string(k + 1) + "/", guesses[k]);
    }
    file_->put_number(group + guesses_list.count, static_cast<Index>(guesses.size()));
  });
}

void SequenceWriter::add_geometry(const Geometry& geometry) {
  file_->add_to_step([&] {
    Geometry::for_each_table([&](std::string_view name, Geometry::Table Geometry::* member) {
      const std::string group(name);
      if ((geometry.*member).empty()) return;
      file_->put_text(group + "@" + geometry_mark, geometry_layout);
      for (const auto& [key, column] : geometry.*member) {
        const std::string path = group + "/" + key;
        std::visit(
            [&]<class Values>(const Values& values) {
              if constexpr (std::is_same_v<Values, std::string>) {
                file_->put_text(path, values);
              } else {
                constexpr bool real = std::is_same_v<Values, std::vector<double>>;
                file_->put(real ? Pool::numbers : Pool::integers, path, values);
              }
            },
            column);
      }
    });
  });
}

void SequenceWriter::add_attributes(const std::string& group, const Attributes& attributes) {
  file_->add_to_step([&] {
    const std::string own = (group == "info" ? info_ : group) + "@";
    for (const auto& [name, value] : attributes) {
      if (const auto* text = std::get_if<std::string>(&value)) {
        file_->put_text(own + name, *text);
      } else {
        file_->put(Pool::numbers, own + name, std::array<double, 1>{std::get<double>(value)});
      }
    }
  });
}

void SequenceWriter::end_step() {
  file_->locked([&] { file_->end_step(); });
}

std::size_t SequenceWriter::size() const {
  return file_->locked([&] { return file_->size(); });
}

void SequenceWriter::flush() {
  file_->locked([&] { file_->flush(); });
}

void SequenceWriter::close() {
  file_->locked([&] { file_->close(); });
}

std::string step_path(const std::string& path, std::size_t k) {
  constexpr std::size_t digits = 6;  // names in order up to a million steps
  const std::string number = std::to_string(k);
  return path + "#" + std::string(digits - std::min(digits, number.size()), '0') + number;
}

std::optional<std::vector<StepOf>> read_steps(const std::string& path) {
  const Session session;
  return in_file(path, [&]() -> std::optional<std::vector<StepOf>> {
    const Handle file = open_file(path);
    const Group root{file.id(), "/"};
    if (!root.has(sequence_group)) return std::nullopt;
    const StoredSequence stored(root);
    std::vector<StepOf> steps;
    for (const StepRow& row : stored.rows(0, stored.size())) {
      steps.push_back({row.world, row.number});
    }
    return steps;
  });
}

}  // namespace fclib
