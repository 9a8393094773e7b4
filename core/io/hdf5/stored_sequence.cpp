#include "io/hdf5/stored_sequence.hpp"

#include <algorithm>
#include <cstddef>
#include <map>
#include <string_view>
#include <tuple>

#include "io/crc32.hpp"
#include "io/hdf5/write_objects.hpp"
#include "number_text.hpp"

namespace fclib::hdf5 {

namespace {

/// Bounds what a hostile file can ask for. Ours have some 20 names for a problem, and as many for
/// each solution and each guess.
constexpr hsize_t most_name_bytes = hsize_t{1} << 20;
constexpr std::size_t longest_path = 255;

template <class Row, class... Members>
Handle compound(Side side, const Members&... members) {
  Handle type(H5Tcreate(H5T_COMPOUND, sizeof(Row)), H5Tclose);
  const auto add = [&](const auto& member) {
    const auto& [name, offset, stored, native] = member;
    H5Tinsert(type.id(), name, offset, side == Side::file ? stored : native);
  };
  (add(members), ...);
  if (side == Side::file) H5Tpack(type.id());
  return type;
}

/// Opens a dataset of records that has all members of this type.
Rows open_records(const Group& group, const std::string& name, const Handle& type) {
  Rows rows = open_rows(group, name, H5T_COMPOUND);
  const Handle stored(H5Dget_type(rows.id.id()), H5Tclose);
  for (int k = 0; k < H5Tget_nmembers(type.id()); ++k) {
    char* const member = H5Tget_member_name(type.id(), static_cast<unsigned>(k));
    const bool there = H5Tget_member_index(stored.id(), member) >= 0;
    const std::string missing = member;
    H5free_memory(member);
    if (!there) fail(rows.path, "has no member " + missing);
  }
  return rows;
}

std::string at(const std::string& path, std::size_t k) {
  return path + "[" + std::to_string(k) + "]";
}

std::vector<ArrayName> read_names(const Group& group) {
  const Rows rows = open_rows(group, "names", H5T_INTEGER);
  if (rows.size > most_name_bytes) {
    fail(rows.path, "has " + std::to_string(rows.size) + " bytes, expected at most " +
                        std::to_string(most_name_bytes));
  }
  std::string text(static_cast<std::size_t>(rows.size), '\0');
  read_rows(rows, 0, rows.size, H5T_NATIVE_UINT8, text.data());
  std::vector<ArrayName> names;
  std::string_view rest = text;
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    const std::string_view line = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    const std::size_t space = line.find(' ');
    const auto* const pool = std::find(pool_names.begin(), pool_names.end(), line.substr(0, space));
    const std::string_view path = space < line.size() ? line.substr(space + 1) : "";
    if (pool == pool_names.end() || path.empty() || path.size() > longest_path ||
        path.front() == '/' || path.back() == '/' || path.find("//") != path.npos ||
        path.find('\0') != path.npos) {
      fail(at(rows.path, names.size()),
           quoted(line) +
               " does not name an array: expected \"numbers\", \"integers\" or "
               "\"texts\", a space and a path");
    }
    names.push_back({static_cast<Pool>(pool - pool_names.begin()), std::string(path)});
  }
  return names;
}

Rows open_pool(const Group& group, Pool pool) {
  return open_rows(group, pool_names[static_cast<std::size_t>(pool)],
                   pool == Pool::numbers ? H5T_FLOAT : H5T_INTEGER);
}

std::size_t width_of(Pool pool) {
  constexpr std::array<std::size_t, 3> widths{sizeof(double), sizeof(std::int32_t), 1};
  return widths[static_cast<std::size_t>(pool)];
}

/// Writes arrays where their names say, with the groups that they need.
class Tree {
 public:
  explicit Tree(const Target& root) : root_(root) {}

  template <class Values>
  void write(const std::string& path, const Values& values) {
    const std::size_t mark = path.find('@');
    if (mark != path.npos) {
      write_attribute(parent(path.substr(0, mark)), path.substr(mark + 1), values);
      return;
    }
    const std::size_t slash = path.rfind('/');
    const Target& group = slash == path.npos ? root_ : parent(path.substr(0, slash));
    const std::string name = path.substr(slash == path.npos ? 0 : slash + 1);
    if constexpr (std::is_same_v<Values, std::string>) {
      write_text(group, name, values);
    } else {
      write_lasting(group, name, values);
    }
  }

 private:
  template <class Values>
  static void write_attribute(const Target& group, const std::string& name, const Values& values) {
    if constexpr (std::is_same_v<Values, std::string>) {
      write_text_attribute(group, name.c_str(), values);
    } else {
      if (values.size() != 1) {
        fail(group.path + ", attribute " + name,
             "has " + std::to_string(values.size()) + " entries, expected one");
      }
      write_number_attribute(group, name.c_str(), values.front());
    }
  }

  const Target& parent(const std::string& path) {
    const auto known = groups_.find(path);
    if (known != groups_.end()) return known->second.target();
    const std::size_t slash = path.rfind('/');
    const Target& above = slash == path.npos ? root_ : parent(path.substr(0, slash));
    const std::string name = path.substr(slash == path.npos ? 0 : slash + 1);
    return groups_
        .emplace(std::piecewise_construct, std::forward_as_tuple(path),
                 std::forward_as_tuple(above, name))
        .first->second.target();
  }

  const Target& root_;
  std::map<std::string, NewGroup> groups_;
};

}  // namespace

std::string ArrayName::line() const {
  return std::string(pool_names[static_cast<std::size_t>(pool)]) + " " + path;
}

void StepChecksum::add(std::string_view line, std::uint32_t of_array) {
  sum_ = crc32_of(std::array{of_array}, crc32(line, sum_));
}

std::uint32_t StepChecksum::of(std::int32_t world, std::int32_t number) const {
  return crc32_of(std::array{world, number}, sum_);
}

Handle type_of_entry(Side side) {
  return compound<Entry>(
      side, std::tuple("name", offsetof(Entry, name), H5T_STD_I32LE, H5T_NATIVE_INT32),
      std::tuple("length", offsetof(Entry, length), H5T_STD_I32LE, H5T_NATIVE_INT32),
      std::tuple("start", offsetof(Entry, start), H5T_STD_I64LE, H5T_NATIVE_INT64));
}

Handle type_of_step(Side side) {
  return compound<StepRow>(
      side, std::tuple("end", offsetof(StepRow, end), H5T_STD_I64LE, H5T_NATIVE_INT64),
      std::tuple("world", offsetof(StepRow, world), H5T_STD_I32LE, H5T_NATIVE_INT32),
      std::tuple("number", offsetof(StepRow, number), H5T_STD_I32LE, H5T_NATIVE_INT32),
      std::tuple("checksum", offsetof(StepRow, checksum), H5T_STD_U32LE, H5T_NATIVE_UINT32));
}

// A file may grow while it is read. All that a step refers to was written before it, so the steps
// are looked up first: the members of the class are in this order.
StoredSequence::StoredSequence(const Group& root)
    : group_(open_group(root, sequence_group)),
      path_(root.child(sequence_group)),
      steps_(open_records({group_.id(), path_}, "steps", type_of_step(Side::memory))),
      entries_(open_records({group_.id(), path_}, "entries", type_of_entry(Side::memory))),
      names_(read_names({group_.id(), path_})) {
  for (const Pool pool : {Pool::numbers, Pool::integers, Pool::texts}) {
    pools_.push_back(open_pool({group_.id(), path_}, pool));
  }
}

std::vector<StepRow> StoredSequence::rows(std::size_t first, std::size_t count) const {
  require_held(steps_, static_cast<double>(count) * sizeof(StepRow), steps_.path);
  std::vector<StepRow> rows(count);
  const Handle type = type_of_step(Side::memory);
  read_rows(steps_, first, count, type.id(), rows.data());
  return rows;
}

std::vector<Entry> StoredSequence::entries_of(std::size_t k) const {
  const std::vector<StepRow> ends = k == 0 ? rows(0, 1) : rows(k - 1, 2);
  const std::int64_t first = k == 0 ? 0 : ends.front().end;
  const std::int64_t end = ends.back().end;
  const auto stored = static_cast<std::int64_t>(entries_.size);
  if (first < 0 || end < first || end > stored) {
    fail(at(steps_.path, k), "has the entries " + std::to_string(first) + " to " +
                                 std::to_string(end) + " of " + std::to_string(stored));
  }
  // each name at most once
  if (static_cast<std::size_t>(end - first) > names_.size()) {
    fail(at(steps_.path, k), "has " + std::to_string(end - first) + " entries, but there are " +
                                 std::to_string(names_.size()) + " names");
  }
  std::vector<Entry> entries(static_cast<std::size_t>(end - first));
  const Handle type = type_of_entry(Side::memory);
  read_rows(entries_, static_cast<hsize_t>(first), entries.size(), type.id(), entries.data());

  std::vector<bool> seen(names_.size());
  std::array<double, pool_names.size()> bytes{};
  for (std::size_t e = 0; e < entries.size(); ++e) {
    const auto [name, length, start] = entries[e];
    const std::string where = at(entries_.path, static_cast<std::size_t>(first) + e);
    if (name < 0 || static_cast<std::size_t>(name) >= names_.size()) {
      fail(where, "has the name " + std::to_string(name) + " of " + std::to_string(names_.size()));
    }
    const auto number = static_cast<std::size_t>(name);
    if (seen[number]) fail(where, "has the name " + names_[number].path + " for the second time");
    seen[number] = true;
    const Rows& pool = pools_[static_cast<std::size_t>(names_[number].pool)];
    if (length < 0 || start < 0 || static_cast<hsize_t>(start) > pool.size ||
        static_cast<hsize_t>(length) > pool.size - static_cast<hsize_t>(start)) {
      fail(where, names_[number].path + " has " + std::to_string(length) + " entries from " +
                      std::to_string(start) + " on, but " + pool.path + " has " +
                      std::to_string(pool.size));
    }
    // no two arrays of a step share a place
    double& all = bytes[static_cast<std::size_t>(names_[number].pool)];
    const auto width = static_cast<double>(width_of(names_[number].pool));
    all += static_cast<double>(length) * width;
    if (all > static_cast<double>(pool.size) * width) {
      fail(where, "the arrays of the step have more entries than " + pool.path);
    }
    require_held(pool, all, where);
  }
  return entries;
}

std::unique_ptr<StepFile> StoredSequence::step(std::size_t k) const {
  auto made = std::make_unique<StepFile>();
  const Style style(0, [&](const void* data, std::size_t size) { made->file_.lend(data, size); });
  const Target root{made->root(), &style};
  Tree tree(root);
  StepChecksum checksum;
  for (const Entry& entry : entries_of(k)) {
    const ArrayName& name = names_[static_cast<std::size_t>(entry.name)];
    const auto length = static_cast<std::size_t>(entry.length);
    const auto start = static_cast<hsize_t>(entry.start);
    const Rows& pool = pools_[static_cast<std::size_t>(name.pool)];
    const auto take = [&](auto values, hid_t memory) {
      values.resize(length);
      read_rows(pool, start, length, memory, values.data());
      checksum.add(name.line(), crc32_of(values));
      const auto& kept = made->arrays_.emplace_back(std::move(values));
      tree.write(name.path, std::get<decltype(values)>(kept));
    };
    if (name.pool == Pool::numbers) take(std::vector<double>(), H5T_NATIVE_DOUBLE);
    if (name.pool == Pool::integers) take(std::vector<std::int32_t>(), H5T_NATIVE_INT32);
    if (name.pool == Pool::texts) take(std::string(), H5T_NATIVE_UINT8);
  }
  const StepRow row = rows(k, 1).front();
  if (checksum.of(row.world, row.number) != row.checksum) {
    fail(at(steps_.path, k),
         "is not as it was written: its checksum is wrong. The file is damaged");
  }
  return made;
}

}  // namespace fclib::hdf5
