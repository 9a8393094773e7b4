#include "io/hdf5/read_objects.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "number_text.hpp"

namespace fclib::hdf5 {

namespace {

/// deflate cannot shrink data further than this
constexpr double best_compression = 1100.0;
constexpr std::size_t small_dataset = std::size_t{1} << 20;

hsize_t size_of_file_with(hid_t object) {
  const Handle file(H5Iget_file_id(object), H5Fclose);
  hsize_t size = 0;
  H5Fget_filesize(file.id(), &size);
  return size;
}

/// The bytes that a dataset takes in its file.
double stored_bytes(hid_t dataset) {
  return static_cast<double>(std::min(H5Dget_storage_size(dataset), size_of_file_with(dataset)));
}

/// Whether the data of a dataset are in one piece in its file. HDF5 adds the size of the user
/// block, a multiple of 512 bytes or 0, to the place of the data, and to HADDR_UNDEF too.
bool is_in_one_piece(hid_t dataset) {
  constexpr haddr_t unit = 512;
  return H5Dget_offset(dataset) % unit != HADDR_UNDEF % unit;
}

/// The properties of a dataset, none where its data are in one piece in its file: to find that out
/// is cheap, to ask for properties is not. Throws where the data are in other files.
Handle properties_of(hid_t dataset, const std::string& path) {
  if (is_in_one_piece(dataset)) return {-1, H5Pclose};
  Handle properties(H5Dget_create_plist(dataset), H5Pclose);
  if (!properties.ok()) fail(path, "has no properties that HDF5 can read");
  if (H5Pget_layout(properties.id()) == H5D_VIRTUAL || H5Pget_external_count(properties.id()) > 0) {
    fail(path, "keeps its data in other places, which are not read");
  }
  return properties;
}

/// Throws if HDF5 would ask for much more memory than the file has data, because there are too many
/// chunks or too large ones. Also throws if HDF5 would unpack data by filters that trust what they
/// read.
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

/// The number of chunks that a dataset needs for all its entries.
double chunks_needed(const Handle& properties, const Handle& space) {
  hsize_t chunk[H5S_MAX_RANK] = {};
  hsize_t extent[H5S_MAX_RANK] = {};
  const int rank = H5Pget_chunk(properties.id(), H5S_MAX_RANK, chunk);
  if (rank < 1 || H5Sget_simple_extent_dims(space.id(), extent, nullptr) != rank) return 0;
  double count = 1;
  for (int k = 0; k < rank; ++k) {
    count *= std::ceil(static_cast<double>(extent[k]) / static_cast<double>(chunk[k]));
  }
  return count;
}

/// Whether a dataset has entries and properties but no room in the file.
bool is_unwritten(const Handle& dataset, const Handle& properties, std::size_t size) {
  H5D_space_status_t status = H5D_SPACE_STATUS_ERROR;
  return size > 0 && H5Pget_layout(properties.id()) != H5D_COMPACT &&
         H5Dget_space_status(dataset.id(), &status) >= 0 &&
         status == H5D_SPACE_STATUS_NOT_ALLOCATED;
}

/// Throws if entries were declared and never written: HDF5 would read its fill value for them.
void require_written(const Handle& dataset, const Handle& properties, const Handle& space,
                     std::size_t size, const std::string& path) {
  if (size == 0 || !properties.ok()) return;
  if (is_unwritten(dataset, properties, size)) {
    fail(path, "was declared and never written: its data are missing");
  }
  const H5D_layout_t layout = H5Pget_layout(properties.id());
#if H5_VERSION_GE(1, 10, 5)
  hsize_t written = 0;
  if (layout == H5D_CHUNKED && H5Dget_num_chunks(dataset.id(), space.id(), &written) >= 0 &&
      static_cast<double>(written) < chunks_needed(properties, space)) {
    fail(path, "was written in part: some of its data are missing");
  }
#endif
}

/// The number of entries of a dataset.
std::size_t size_of(const Handle& space, const std::string& path) {
  const hssize_t points = H5Sget_simple_extent_npoints(space.id());
  if (points < 0) fail(path, "has no size");
  return static_cast<std::size_t>(points);
}

bool is_flat(const Handle& space) {
  hsize_t extents[H5S_MAX_RANK] = {};
  const int rank = H5Sget_simple_extent_dims(space.id(), extents, nullptr);
  return std::count_if(extents, extents + std::max(rank, 0), [](hsize_t n) { return n != 1; }) <= 1;
}

/// Whether all numbers of a type fit an integer of 32 bits.
bool is_narrow(const Handle& type) {
  return H5Tget_class(type.id()) == H5T_INTEGER &&
         H5Tget_precision(type.id()) < (H5Tget_sign(type.id()) == H5T_SGN_NONE ? 32 : 33);
}

/// Why HDF5 could not read a dataset.
std::string reason_of(const Numbers& dataset) {
  const Handle properties(H5Dget_create_plist(dataset.id.id()), H5Pclose);
  for (int k = 0; k < H5Pget_nfilters(properties.id()); ++k) {
    std::size_t values = 0;
    std::array<char, 64> name{};
    const H5Z_filter_t filter =
        H5Pget_filter2(properties.id(), static_cast<unsigned>(k), nullptr, &values, nullptr,
                       name.size() - 1, name.data(), nullptr);
    if (filter >= 0 && H5Zfilter_avail(filter) <= 0) {
      return "is packed by a filter that is not installed (" + std::string(name.data()) +
             ", number " + std::to_string(filter) + ")";
    }
  }
  return "cannot be read (the file is damaged or cut short)";
}

void read_as(const Numbers& dataset, hid_t memory, void* values) {
  if (dataset.size > 0 &&
      !read_chunks(dataset.id.id(), dataset.packing, memory, dataset.size, values) &&
      H5Dread(dataset.id.id(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) {
    fail(dataset.path, reason_of(dataset));
  }
}

}  // namespace

Numbers open_numbers(const Group& group, const std::string& name) {
  const std::string path = group.child(name);
  if (!group.has(name)) fail(path, "the dataset is missing");
  Handle dataset(H5Dopen2(group.id, name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!dataset.ok()) fail(path, "is not a dataset that HDF5 can open");
  const Handle type(H5Dget_type(dataset.id()), H5Tclose);
  const H5T_class_t kind = H5Tget_class(type.id());
  if (kind != H5T_INTEGER && kind != H5T_FLOAT) fail(path, "does not hold numbers");
  const Handle space(H5Dget_space(dataset.id()), H5Sclose);
  const std::size_t size = size_of(space, path);
  const auto entry_size = static_cast<double>(H5Tget_size(type.id()));
  const double bytes = static_cast<double>(size) * entry_size;
  const Handle properties = properties_of(dataset.id(), path);
  if (bytes > static_cast<double>(small_dataset) &&
      bytes > best_compression * stored_bytes(dataset.id())) {
    fail(path, "declares " + std::to_string(size) + " entries, but the file does not hold them");
  }
  require_chunks(properties, dataset.id(), static_cast<double>(size), entry_size, path);
  require_written(dataset, properties, space, size, path);
  if (size > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max())) {
    fail(path, "has " + std::to_string(size) + " entries, more than can be numbered");
  }
  const bool narrow = is_narrow(type);
  return {std::move(dataset),
          path,
          size,
          kind == H5T_FLOAT,
          narrow,
          is_flat(space),
          properties.ok() ? packing_of(properties.id()) : Packing()};
}

bool is_unwritten(const Group& group, const std::string& name) {
  if (!group.has(name)) return false;
  const Handle dataset(H5Dopen2(group.id, name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!dataset.ok()) return false;
  const Handle space(H5Dget_space(dataset.id()), H5Sclose);
  const Handle properties = properties_of(dataset.id(), group.child(name));
  return properties.ok() && is_unwritten(dataset, properties, size_of(space, group.child(name)));
}

void read_into(const Numbers& dataset, double* values) {
  read_as(dataset, H5T_NATIVE_DOUBLE, values);
}

void read_into(const Numbers& dataset, std::int32_t* values) {
  if (dataset.narrow) {
    read_as(dataset, H5T_NATIVE_INT32, values);
    return;
  }
  // HDF5 would clip numbers that do not fit, and cut numbers that are not integers
  if (dataset.real) {
    std::vector<double> wide(dataset.size);
    read_into(dataset, wide.data());
    for (std::size_t k = 0; k < wide.size(); ++k) {
      using Limits = std::numeric_limits<std::int32_t>;
      const bool fits = wide[k] >= Limits::min() && wide[k] <= Limits::max();
      if (!fits || wide[k] != std::trunc(wide[k])) {
        fail(dataset.path + "[" + std::to_string(k) + "]",
             shortest(wide[k]) + " is not an integer of 32 bits");
      }
      values[k] = static_cast<std::int32_t>(wide[k]);
    }
    return;
  }
  std::vector<std::int64_t> wide(dataset.size);
  read_as(dataset, H5T_NATIVE_INT64, wide.data());
  using Limits = std::numeric_limits<std::int32_t>;
  for (std::size_t k = 0; k < wide.size(); ++k) {
    if (wide[k] < Limits::min() || wide[k] > Limits::max()) {
      fail(dataset.path + "[" + std::to_string(k) + "]",
           std::to_string(wide[k]) + " does not fit a 32-bit integer");
    }
    values[k] = static_cast<std::int32_t>(wide[k]);
  }
}

Rows open_rows(const Group& group, const std::string& name, H5T_class_t kind) {
  const std::string path = group.child(name);
  if (!group.has(name)) fail(path, "the dataset is missing");
  Handle dataset(H5Dopen2(group.id, name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!dataset.ok()) fail(path, "is not a dataset that HDF5 can open");
  const Handle type(H5Dget_type(dataset.id()), H5Tclose);
  if (H5Tget_class(type.id()) != kind || (kind == H5T_INTEGER && !is_narrow(type))) {
    fail(path, "has entries of another type");
  }
  const Handle space(H5Dget_space(dataset.id()), H5Sclose);
  hsize_t size = 0;
  if (H5Sget_simple_extent_ndims(space.id()) != 1 ||
      H5Sget_simple_extent_dims(space.id(), &size, nullptr) != 1) {
    fail(path, "does not have one dimension");
  }
  const Handle properties = properties_of(dataset.id(), path);
  require_chunks(properties, dataset.id(), static_cast<double>(size),
                 static_cast<double>(H5Tget_size(type.id())), path);
  hsize_t chunk = 0;
  if (properties.ok() && H5Pget_layout(properties.id()) == H5D_CHUNKED) {
    H5Pget_chunk(properties.id(), 1, &chunk);
  } else if (properties.ok() && is_unwritten(dataset, properties, static_cast<std::size_t>(size))) {
    fail(path, "was declared and never written: its data are missing");
  }
  return {std::move(dataset), path, size, chunk};
}

void require_held(const Rows& rows, double bytes, const std::string& where) {
  const auto held = static_cast<double>(size_of_file_with(rows.id.id()));
  if (bytes > best_compression * held) {
    fail(where, "declares " + shortest(bytes) + " bytes, but the file does not hold them");
  }
}

void read_rows(const Rows& rows, hsize_t first, hsize_t count, hid_t memory, void* values) {
  if (count == 0) return;
#if H5_VERSION_GE(1, 10, 5)
  for (hsize_t at = first; rows.chunk > 0 && at < first + count; at += rows.chunk) {
    unsigned mask = 0;
    haddr_t address = HADDR_UNDEF;
    hsize_t bytes = 0;
    const hsize_t chunk = at - at % rows.chunk;
    if (H5Dget_chunk_info_by_coord(rows.id.id(), &chunk, &mask, &address, &bytes) < 0 ||
        address == HADDR_UNDEF) {
      fail(rows.path + "[" + std::to_string(std::max(chunk, first)) + "]",
           "was never written: its data are missing");
    }
    at = chunk;
  }
#endif
  const Handle space(H5Dget_space(rows.id.id()), H5Sclose);
  const Handle room(H5Screate_simple(1, &count, nullptr), H5Sclose);
  if (H5Sselect_hyperslab(space.id(), H5S_SELECT_SET, &first, nullptr, &count, nullptr) < 0 ||
      H5Dread(rows.id.id(), memory, room.id(), space.id(), H5P_DEFAULT, values) < 0) {
    fail(rows.path + "[" + std::to_string(first) + "]",
         "cannot be read (the file is damaged or cut short)");
  }
}

std::string read_text(const Group& group, const std::string& name) {
  const std::string path = group.child(name);
  if (!group.has(name)) fail(path, "the dataset is missing");
  const Handle dataset(H5Dopen2(group.id, name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!dataset.ok()) fail(path, "is not a dataset that HDF5 can open");
  const Handle type(H5Dget_type(dataset.id()), H5Tclose);
  const Handle space(H5Dget_space(dataset.id()), H5Sclose);
  const H5T_class_t kind = H5Tget_class(type.id());
  const std::size_t points = size_of(space, path);
  const bool as_bytes = kind == H5T_INTEGER && H5Tget_size(type.id()) == 1 && is_flat(space);
  if (kind != H5T_STRING && !as_bytes) fail(path, "does not hold text");
  if (points != 1 && !as_bytes) {
    fail(path, "holds " + std::to_string(points) + " texts, expected one");
  }
  const std::size_t length = as_bytes ? points : H5Tget_size(type.id());
  const Handle properties = properties_of(dataset.id(), path);
  const double entries = as_bytes ? static_cast<double>(points) : 1;
  require_chunks(properties, dataset.id(), entries, static_cast<double>(length) / entries, path);
  if (H5Tis_variable_str(type.id()) > 0) {
    require_written(dataset, properties, space, points, path);
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
  require_written(dataset, properties, space, points, path);
  std::string text(length, '\0');
  if (H5Dread(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, text.data()) < 0) {
    fail(path, "cannot be read");
  }
  text.resize(std::min(text.find('\0'), text.size()));
  return text;
}

}  // namespace fclib::hdf5
