#include "io/hdf5/write_objects.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <list>
#include <utility>
#include <vector>

#include "io/hdf5/chunks.hpp"

namespace fclib::hdf5 {

namespace {

/// For a smaller dataset, a chunk and a filter do not pay.
constexpr std::size_t chunked_from = 64;
/// The size of a reader's cache for one dataset, by HDF5's default.
constexpr std::size_t chunk_bytes = std::size_t{1} << 20;
/// The bytes that the index of a dataset in chunks takes.
constexpr std::size_t index_bytes = 254;
/// The number of entries from which the filter of an array is chosen.
constexpr std::size_t sample_entries = std::size_t{1} << 12;
/// Datasets up to this many bytes are in their own header.
constexpr std::size_t compact_bytes = 4096;
/// Groups of up to this many members keep them in their own header. All of ours do.
constexpr unsigned compact_links = 32;

/// The ways to store an array.
enum class Filter { none, deflate, shuffle_and_deflate };

/// An array to write, and its types in the file and in memory.
struct Array {
  hid_t stored;
  hid_t memory;
  const void* data;
  std::size_t size;

  [[nodiscard]] std::size_t width() const { return H5Tget_size(stored); }
  [[nodiscard]] std::size_t bytes() const { return size * width(); }
};

Handle dataset_properties() {
  Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_obj_track_times(properties.id(), false);
#if H5_VERSION_GE(1, 10, 5)
  H5Pset_dset_no_attrs_hint(properties.id(), true);
#endif
  return properties;
}

Handle create_dataset(const Group& group, const std::string& name, const Array& array,
                      const Handle& layout) {
  const hsize_t extent = array.size;
  const Handle space(H5Screate_simple(1, &extent, nullptr), H5Sclose);
  Handle dataset(H5Dcreate2(group.id, name.c_str(), array.stored, space.id(), H5P_DEFAULT,
                            layout.id(), H5P_DEFAULT),
                 H5Dclose);
  if (!dataset.ok()) fail(group.child(name), "cannot be created");
  return dataset;
}

void write_all(const Handle& dataset, const Array& array, const std::string& path) {
  check(H5Dwrite(dataset.id(), array.memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, array.data), path);
}

/// How many different values these doubles have.
std::size_t distinct(const double* values, std::size_t size) {
  // a table with a place for each value, at most half full; 0 marks an empty place and is counted
  // apart
  std::vector<std::uint64_t> table(2 * std::bit_ceil(size));
  std::size_t count = 0;
  bool zero = false;
  for (std::size_t k = 0; k < size; ++k) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, values + k, sizeof bits);
    if (bits == 0) {
      zero = true;
      continue;
    }
    std::size_t place = (bits * 0x9E3779B97F4A7C15U >> 32U) % table.size();
    while (table[place] != 0 && table[place] != bits) place = (place + 1) % table.size();
    if (table[place] == bits) continue;
    table[place] = bits;
    ++count;
  }
  return count + (zero ? 1 : 0);
}

/// The bytes that doubles take byte by byte: each byte takes the bits that follow from its
/// frequency among the bytes at its place.
double bytes_by_planes(const double* values, std::size_t size) {
  std::array<std::array<std::uint32_t, 256>, sizeof(double)> counts{};
  const auto* bytes = reinterpret_cast<const unsigned char*>(values);
  for (std::size_t k = 0; k < size; ++k) {
    for (std::size_t plane = 0; plane < counts.size(); ++plane) {
      ++counts[plane][bytes[counts.size() * k + plane]];
    }
  }
  double bits = 0;
  const auto all = static_cast<double>(size);
  for (const auto& plane : counts) {
    for (const std::uint32_t count : plane) {
      if (count > 0) bits += count * std::log2(all / count);
    }
  }
  return bits / 8;
}

/// The filter that makes an array small. For doubles, it predicts what deflate will leave, from
/// their first entries. Shuffling gathers the bytes that numbers of one size share, but it hides
/// repeated numbers. Without shuffling, deflate finds those, at one to two bytes each. Indices are
/// always shuffled. (A trial of both would save 0.7 % of the bytes of the collection.)
Filter likely_filter(const Array& array) {
  if (H5Tget_size(array.stored) != sizeof(double)) return Filter::shuffle_and_deflate;
  const auto* values = static_cast<const double*>(array.data);
  const std::size_t size = std::min(array.size, sample_entries);
  const auto fresh = static_cast<double>(distinct(values, size));
  const double repeated = static_cast<double>(size) - fresh;
  const double bytes = sizeof(double) * static_cast<double>(size);
  const double plain = (7.6 * fresh + 1.6 * repeated) / bytes;
  const double shuffled = bytes_by_planes(values, size) / bytes;
  const auto all = static_cast<double>(array.bytes());
  if (all * std::min(plain, shuffled) + index_bytes > all) return Filter::none;
  return plain < shuffled ? Filter::deflate : Filter::shuffle_and_deflate;
}

/// How an array is packed, and the packed bytes.
struct Packed {
  struct Chunk {
    std::string bytes;
    std::uint32_t mask;
  };
  Filter filter;
  std::vector<Chunk> chunks;  // none: HDF5 makes them, or there is no filter
};

/// How many numbers of an array are in a chunk.
hsize_t chunk_of(const Array& array) { return std::min(array.size, chunk_bytes / array.width()); }

bool pack_array(const Array& array, Filter filter, int level, const TakeChunk& take) {
  return pack({static_cast<const char*>(array.data), array.size, array.width()},
              {chunk_of(array), filter == Filter::shuffle_and_deflate}, level, take);
}

/// The last packed arrays. The files of a sequence share many of them: the shapes of bodies and the
/// patterns of matrices. The two forms of a problem share all that describes its contacts.
class Recent {
 public:
  static constexpr std::size_t most_bytes = std::size_t{1} << 23;
  static constexpr std::size_t largest = most_bytes / 4;  // bytes of an array that is kept

  /// The result stays until the next call.
  const Packed& of(const Array& array, int level) {
    const std::size_t bytes = array.bytes();
    const auto* data = static_cast<const char*>(array.data);
    const Key key{bytes, array.width(), static_cast<std::size_t>(level), sampled(data, bytes)};
    for (auto one = known_.begin(); one != known_.end(); ++one) {
      if (one->key != key || std::memcmp(one->raw.data(), data, bytes) != 0) continue;
      known_.splice(known_.begin(), known_, one);
      return one->packed;
    }
    Packed packed{likely_filter(array), {}};
    if (packed.filter != Filter::none) {
      pack_array(array, packed.filter, level, [&](std::string_view chunk, std::uint32_t mask) {
        packed.chunks.push_back({std::string(chunk), mask});
      });
    }
    known_.push_front({key, std::string(data, bytes), std::move(packed)});
    bytes_ += bytes;
    while (bytes_ > most_bytes || known_.size() > most_arrays) {
      bytes_ -= known_.back().raw.size();
      known_.pop_back();
    }
    return known_.front().packed;
  }

 private:
  using Key = std::array<std::size_t, 4>;
  struct Known {
    Key key;
    std::string raw;
    Packed packed;
  };
  static constexpr std::size_t most_arrays = 128;

  /// A hash of some of the bytes. It distinguishes most arrays.
  static std::size_t sampled(const char* data, std::size_t bytes) {
    constexpr std::size_t samples = 64;
    const std::size_t words = bytes / sizeof(std::uint64_t);
    const std::size_t stride = std::max<std::size_t>(words / samples, 1);
    std::uint64_t hash = 0;
    for (std::size_t k = 0; k < words; k += stride) {
      std::uint64_t word = 0;
      std::memcpy(&word, data + k * sizeof word, sizeof word);
      hash = (hash ^ word) * 0x9E3779B97F4A7C15U;
      hash ^= hash >> 32U;
    }
    return hash;
  }

  std::list<Known> known_;  // the latest first
  std::size_t bytes_ = 0;   // of the arrays
};

/// Used under the library's lock, like everything here.
Recent& recent() {
  static Recent made;
  return made;
}

/// A new dataset in chunks. `fill` writes them by its function, or returns that HDF5 must.
template <class Fill>
void write_packed(const Target& group, const std::string& name, const Array& array, Filter filter,
                  const Fill& fill) {
  const Style& style = *group.style;
  const Handle& layout = filter == Filter::deflate ? style.deflated : style.shuffled;
  const hsize_t chunk = chunk_of(array);
  H5Pset_chunk(layout.id(), 1, &chunk);
  const Handle dataset = create_dataset(group, name, array, layout);
  hsize_t offset = 0;
  const auto write = [&](std::string_view bytes, std::uint32_t mask) {
    check(H5Dwrite_chunk(dataset.id(), H5P_DEFAULT, mask, &offset, bytes.size(), bytes.data()),
          group.child(name));
    offset += chunk;
  };
  if (!fill(write)) write_all(dataset, array, group.child(name));
}

/// Writes an array in chunks if filters make it smaller. Returns whether it did.
bool write_smaller(const Target& group, const std::string& name, const Array& array) {
  const int level = group.style->compression;
  if (array.size < chunked_from || level == 0) return false;
  if (array.bytes() > Recent::largest) {
    const Filter filter = likely_filter(array);
    if (filter == Filter::none) return false;
    write_packed(group, name, array, filter,
                 [&](const auto& write) { return pack_array(array, filter, level, write); });
    return true;
  }
  const Packed& packed = recent().of(array, level);
  if (packed.filter == Filter::none) return false;
  write_packed(group, name, array, packed.filter, [&](const auto& write) {
    for (const auto& [bytes, mask] : packed.chunks) write(bytes, mask);
    return !packed.chunks.empty();
  });
  return true;
}

void write_array(const Target& group, const std::string& name, const Array& array) {
  if (write_smaller(group, name, array)) return;
  const Style& style = *group.style;
  const Handle& layout = array.bytes() <= compact_bytes ? style.compact : style.plain;
  const Handle dataset = create_dataset(group, name, array, layout);
  if (array.size > 0) write_all(dataset, array, group.child(name));
}

Handle text_type(const std::string& text) {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.id(), text.size() + 1);
  return type;
}

Handle group_properties() {
  Handle properties(H5Pcreate(H5P_GROUP_CREATE), H5Pclose);
  keep_small(properties.id());
  return properties;
}

Handle compact_properties() {
  Handle properties = dataset_properties();
  H5Pset_layout(properties.id(), H5D_COMPACT);
  return properties;
}

Handle packed_properties(int level, bool shuffled) {
  Handle properties = dataset_properties();
  if (shuffled) H5Pset_shuffle(properties.id());
  H5Pset_deflate(properties.id(), static_cast<unsigned>(level));
  return properties;
}

}  // namespace

Style::Style(int level, std::function<void(const void* data, std::size_t size)> lend_of)
    : compression(level),
      lend(std::move(lend_of)),
      group(group_properties()),
      plain(dataset_properties()),
      compact(compact_properties()),
      deflated(packed_properties(level, false)),
      shuffled(packed_properties(level, true)) {}

void keep_small(hid_t properties) {
  check(H5Pset_link_phase_change(properties, compact_links, compact_links), "");
  check(H5Pset_est_link_info(properties, 4, 6), "");
  check(H5Pset_obj_track_times(properties, false), "");  // the same problem gives the same bytes
}

Handle create_group(const Target& parent, const std::string& name) {
  Handle group(
      H5Gcreate2(parent.id, name.c_str(), H5P_DEFAULT, parent.style->group.id(), H5P_DEFAULT),
      H5Gclose);
  if (!group.ok()) fail(parent.child(name), "cannot be created");
  return group;
}

void write_numbers(const Target& group, const std::string& name, const double* values,
                   std::size_t size) {
  write_array(group, name, {H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values, size});
}

void write_numbers(const Target& group, const std::string& name, const std::int32_t* values,
                   std::size_t size) {
  write_array(group, name, {H5T_STD_I32LE, H5T_NATIVE_INT32, values, size});
}

void write_text(const Target& group, const std::string& name, const std::string& text) {
  const Handle type = text_type(text);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Style& style = *group.style;
  const Handle& layout = text.size() < compact_bytes ? style.compact : style.plain;
  const Handle dataset(H5Dcreate2(group.id, name.c_str(), type.id(), space.id(), H5P_DEFAULT,
                                  layout.id(), H5P_DEFAULT),
                       H5Dclose);
  if (!dataset.ok()) fail(group.child(name), "cannot be created");
  check(H5Dwrite(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, text.c_str()),
        group.child(name));
}

void write_attribute(const Group& group, const char* name, hid_t stored, const Handle& space,
                     hid_t memory, const void* value) {
  const std::string where = group.path + ", attribute " + name;
  const Handle attribute(H5Acreate2(group.id, name, stored, space.id(), H5P_DEFAULT, H5P_DEFAULT),
                         H5Aclose);
  if (!attribute.ok()) fail(where, "cannot be created");
  check(H5Awrite(attribute.id(), memory, value), where);
}

void write_text_attribute(const Group& group, const char* name, const std::string& text) {
  const Handle type = text_type(text);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  write_attribute(group, name, type.id(), space, type.id(), text.c_str());
}

void write_number_attribute(const Group& group, const char* name, double value) {
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  write_attribute(group, name, H5T_IEEE_F64LE, space, H5T_NATIVE_DOUBLE, &value);
}

}  // namespace fclib::hdf5
