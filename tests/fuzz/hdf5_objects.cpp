// Valid FCLIB files in which objects are changed through the HDF5 library: the bytes choose the
// file, and then change after change. What is read is always sound HDF5, so that all that goes
// wrong is ours.
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "fuzz.hpp"
#include "io/hdf5/hdf5.hpp"
#include "io/replace_file.hpp"
#include "read_all.hpp"
#include "small_problems.hpp"

namespace fclib::fuzz {

namespace {

/// Choices made from bytes; zeros when they are used up.
class Choices {
 public:
  explicit Choices(std::string_view bytes) : rest_(bytes) {}

  [[nodiscard]] bool empty() const { return rest_.empty(); }

  std::uint8_t byte() {
    if (rest_.empty()) return 0;
    const auto value = static_cast<std::uint8_t>(rest_.front());
    rest_.remove_prefix(1);
    return value;
  }

  template <class List>
  const auto& one_of(const List& list) {
    return list[byte() % std::size(list)];
  }

  bool one_in(int n) { return byte() % n == n - 1; }

  /// Mostly small.
  std::int64_t integer() {
    static constexpr std::int64_t special[] = {255,
                                               256,
                                               65535,
                                               1 << 20,
                                               0x7fffffff,
                                               -0x7fffffffLL - 1,
                                               0x7ffffffe,
                                               0x80000000,
                                               1LL << 32,
                                               1LL << 40,
                                               1LL << 62,
                                               0x55555556,
                                               0x2aaaaaab,
                                               715827883,
                                               46341,
                                               1073741824,
                                               100000,
                                               std::numeric_limits<std::int64_t>::max(),
                                               std::numeric_limits<std::int64_t>::min()};
    const std::uint8_t first = byte();
    return first < 200 ? first - 40 : special[(first - 200) % std::size(special)];
  }

  double number() {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    static constexpr double special[] = {
        0.0,   -0.0,   infinity, -infinity, std::numeric_limits<double>::quiet_NaN(),
        1e308, -1e308, 5e-324,   1e-200,    1e200,
        0.5};
    const std::uint8_t first = byte();
    return first < 200 ? (first - 20) / 8.0 : special[(first - 200) % std::size(special)];
  }

 private:
  std::string_view rest_;
};

struct Base {
  std::string bytes;
  std::vector<std::string> paths;  // of its objects
};

std::vector<Base> make_bases() {
  std::vector<Base> bases;
  const std::string path = (scratch() / "base.hdf5").string();
  const auto add = [&] {
    Base base{.bytes = read_file(path), .paths = {}};
    const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
    H5Lvisit(
        file, H5_INDEX_NAME, H5_ITER_INC,
        [](hid_t, const char* name, const H5L_info_t*, void* data) -> herr_t {
          static_cast<Base*>(data)->paths.emplace_back(name);
          return 0;
        },
        &base);
    H5Fclose(file);
    // and what could be there
    for (const char* more : {"guesses/2", "guesses/1/r", "solution", "solution/v"}) {
      base.paths.emplace_back(more);
    }
    bases.push_back(std::move(base));
  };
  for_each_small_problem([&](const std::string&, const auto& problem) {
    auto informed = problem;
    for_each_field<std::decay_t<decltype(problem)>>([&](const auto& field) {
      if constexpr (std::is_same_v<std::decay_t<decltype(problem.*field.member)>, Matrix>) {
        if (!(informed.*field.member).empty()) {
          (informed.*field.member).info = MatrixInfo{.comment = "of full rank", .rank = 3};
        }
      }
    });
    const Solution solution = small_solution(problem);
    write_file(path, &informed, &solution);
    if (is_mixed(problem)) write_guesses(path, {solution, solution});
    write_attributes(path, "solution", {{"error", 1e-9}, {"solver", std::string("nsgs")}});
    write_attributes(path, "info", {{"rank", 3.0}, {"existence", std::string("yes")}});
    add();
  });
  // several in one file
  const auto local = small_problem<LocalProblem>(2, 1, true, Storage::csr);
  const auto global = small_problem<GlobalProblem>(2, 1, false, Storage::triplet);
  write_file(path, &local);
  write_file(path, &global, nullptr, {}, {.append = true});
  add();
  return bases;
}

const std::vector<Base>& bases() {
  static const std::vector<Base> result = make_bases();
  return result;
}

// ---- types, spaces and layouts

/// A new type, or a copy of one that is there.
hid_t choose_type(Choices& choices) {
  const auto sized = [&](hid_t model) {
    const hid_t type = H5Tcopy(model);
    H5Tset_size(type, static_cast<std::size_t>(choices.byte()) + 1);
    return type;
  };
  switch (choices.byte() % 28) {
    case 0:
      return H5Tcopy(H5T_STD_I8LE);
    case 1:
      return H5Tcopy(H5T_STD_U8LE);
    case 2:
      return H5Tcopy(H5T_STD_I16BE);
    case 3:
      return H5Tcopy(H5T_STD_U16LE);
    case 4:
      return H5Tcopy(H5T_STD_I32BE);
    case 5:
      return H5Tcopy(H5T_STD_U32LE);
    case 6:
      return H5Tcopy(H5T_STD_I64LE);
    case 7:
      return H5Tcopy(H5T_STD_U64BE);
    case 8:
      return H5Tcopy(H5T_IEEE_F32BE);
    case 9:
      return H5Tcopy(H5T_NATIVE_LDOUBLE);
    case 10: {  // an integer that fills a part of its bytes
      const hid_t type = H5Tcopy(choices.one_in(2) ? H5T_STD_I32LE : H5T_STD_U64BE);
      H5Tset_precision(type, static_cast<std::size_t>(choices.byte() % 40) + 1);
      H5Tset_offset(type, choices.byte() % 16);
      return type;
    }
    case 11: {  // of as many bytes as one likes
      return sized(H5T_STD_I64LE);
    }
    case 12: {  // a short real number
      const hid_t type = H5Tcopy(H5T_IEEE_F32LE);
      H5Tset_fields(type, 15, 10, 5, 0, 10);
      H5Tset_precision(type, 16);
      H5Tset_size(type, 2);
      H5Tset_ebias(type, 15);
      return type;
    }
    case 13:
      return sized(H5T_C_S1);
    case 14: {
      const hid_t type = sized(H5T_C_S1);
      H5Tset_strpad(type, choices.one_in(2) ? H5T_STR_SPACEPAD : H5T_STR_NULLPAD);
      H5Tset_cset(type, H5T_CSET_UTF8);
      return type;
    }
    case 15: {
      const hid_t type = H5Tcopy(H5T_C_S1);
      H5Tset_size(type, H5T_VARIABLE);
      return type;
    }
    case 16: {
      const hid_t type = H5Tcreate(H5T_COMPOUND, 16);
      H5Tinsert(type, "r", 0, H5T_NATIVE_DOUBLE);
      H5Tinsert(type, "i", 8, H5T_NATIVE_DOUBLE);
      return type;
    }
    case 17: {
      const hid_t type = H5Tcreate(H5T_ENUM, 1);
      for (std::int8_t value = 0; value < 2; ++value) {
        H5Tenum_insert(type, value == 0 ? "FALSE" : "TRUE", &value);
      }
      return type;
    }
    case 18:
      return sized(H5T_NATIVE_OPAQUE);
    case 19:
      return H5Tcopy(H5T_STD_REF_OBJ);
    case 20: {
      const hsize_t extent = static_cast<hsize_t>(choices.byte() % 4) + 1;
      return H5Tarray_create2(H5T_NATIVE_DOUBLE, 1, &extent);
    }
    case 21:
      return H5Tvlen_create(H5T_NATIVE_INT32);
    case 22:
      return H5Tcopy(H5T_STD_B32LE);
    case 23:
    case 24:
      return H5Tcopy(H5T_STD_I32LE);
    default:
      return H5Tcopy(H5T_IEEE_F64LE);
  }
}

hsize_t choose_extent(Choices& choices) {
  static constexpr hsize_t large[] = {63,         64,         100,       4096,       65537,
                                      1 << 20,    1 << 24,    1 << 27,   1ULL << 31, 1ULL << 33,
                                      1ULL << 40, 1ULL << 58, 1ULL << 62};
  const std::uint8_t first = choices.byte();
  return first < 220 ? first % 20 : large[(first - 220) % std::size(large)];
}

/// `usual` points in one dimension, or anything else.
hid_t choose_space(Choices& choices, hsize_t usual) {
  std::array<hsize_t, 3> extents{usual, 1, 1};
  std::array<hsize_t, 3> limits{H5S_UNLIMITED, H5S_UNLIMITED, H5S_UNLIMITED};
  const std::uint8_t choice = choices.byte();
  const bool limited = choice % 2 == 0;
  int rank = 1;
  switch (choice / 2 % 12) {
    case 0:
      return H5Screate(H5S_NULL);
    case 1:
      return H5Screate(H5S_SCALAR);
    case 2:
      rank = 2;
      for (auto& extent : extents) extent = choose_extent(choices);
      break;
    case 3:
      rank = 3;
      for (auto& extent : extents) extent = choose_extent(choices);
      break;
    case 4:
    case 5:
    case 6:
      extents[0] = choose_extent(choices);
      break;
    default:
      break;
  }
  return H5Screate_simple(rank, extents.data(), limited ? nullptr : limits.data());
}

constexpr std::size_t most_bytes = std::size_t{1} << 20;  // of a chunk, and of what is written

/// Properties of a new dataset: layout, filters, fill value, data in other files.
hid_t choose_layout(Choices& choices, hid_t space, hid_t type) {
  const hid_t layout = H5Pcreate(H5P_DATASET_CREATE);
  const std::uint8_t choice = choices.byte();
  const auto value = choices.number();
  if (choice >= 128) H5Pset_fill_value(layout, H5T_NATIVE_DOUBLE, &value);
  switch (choice % 8) {
    case 0:
      H5Pset_layout(layout, H5D_COMPACT);
      break;
    case 1:
    case 2:
    case 3: {
      const int rank = H5Sget_simple_extent_ndims(space);
      if (rank < 1) break;
      static constexpr hsize_t sizes[] = {1, 2, 7, 64, 1000, 1 << 17};
      std::array<hsize_t, 3> chunk{1, 1, 1};
      chunk[0] = choices.one_of(sizes);
      if (chunk[0] * H5Tget_size(type) > most_bytes) chunk[0] = 1;
      H5Pset_chunk(layout, rank, chunk.data());
      const std::uint8_t filters = choices.byte();
      if ((filters & 1) != 0) H5Pset_shuffle(layout);
      if ((filters & 2) != 0) H5Pset_deflate(layout, 6);
      if ((filters & 4) != 0) H5Pset_fletcher32(layout);
      break;
    }
    case 4:
      H5Pset_alloc_time(layout, H5D_ALLOC_TIME_LATE);
      break;
    case 5:
      if (choices.one_in(4)) {
        static const std::string files[] = {"/dev/zero", (scratch() / "data").string()};
        H5Pset_external(layout, choices.one_of(files).c_str(), 0,
                        choices.one_in(2) ? H5F_UNLIMITED : 1000);
      }
      break;
    case 6:
      if (choices.one_in(4)) {
        static const char* const files[] = {".", "nothing.hdf5"};
        static const char* const sources[] = {"/fclib_local/W/x", "/fclib_local/vectors/q",
                                              "/fclib_global/vectors/f"};
        H5Pset_virtual(layout, space, choices.one_of(files), choices.one_of(sources), space);
      }
      break;
    default:
      break;
  }
  return layout;
}

// ---- changes

std::string choose_path(Choices& choices, const Base& base) { return choices.one_of(base.paths); }

void remove(hid_t file, const std::string& path) { H5Ldelete(file, path.c_str(), H5P_DEFAULT); }

/// The numbers of a small dataset; none of what is no such thing.
std::vector<double> numbers_of(hid_t file, const std::string& path) {
  std::vector<double> values;
  const hid_t dataset = H5Dopen2(file, path.c_str(), H5P_DEFAULT);
  if (dataset < 0) return values;
  const hid_t space = H5Dget_space(dataset);
  const hssize_t points = H5Sget_simple_extent_npoints(space);
  if (points > 0 && points < 10000) {
    values.resize(static_cast<std::size_t>(points));
    if (H5Dread(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) {
      values.clear();
    }
  }
  H5Sclose(space);
  H5Dclose(dataset);
  return values;
}

/// Whether a dataset in chunks takes seconds to write: very many chunks, or much larger ones than
/// their data.
bool is_slow(hid_t dataset, hid_t made) {
  constexpr double most_chunks = 2000;
  constexpr double most_room = 1 << 24;
  std::array<hsize_t, H5S_MAX_RANK> chunk{};
  std::array<hsize_t, H5S_MAX_RANK> extents{};
  const int rank = H5Pget_chunk(made, H5S_MAX_RANK, chunk.data());
  const hid_t space = H5Dget_space(dataset);
  H5Sget_simple_extent_dims(space, extents.data(), nullptr);
  H5Sclose(space);
  const hid_t type = H5Dget_type(dataset);
  double chunks = 1;
  auto room = static_cast<double>(H5Tget_size(type));
  H5Tclose(type);
  for (std::size_t k = 0; k < static_cast<std::size_t>(rank); ++k) {
    const double along = std::ceil(static_cast<double>(extents[k]) / static_cast<double>(chunk[k]));
    chunks *= along;
    room *= along * static_cast<double>(chunk[k]);
  }
  return chunks > most_chunks || room > most_room;
}

/// A virtual dataset is left unwritten: HDF5 1.10 follows one that leads to itself without end, and
/// leaves the files open where it fails.
void write(hid_t dataset, hid_t type, hid_t memory, hid_t space, hid_t transfer,
           const void* values) {
  const hid_t made = H5Dget_create_plist(dataset);
  const H5D_layout_t layout = H5Pget_layout(made);
  if (layout != H5D_VIRTUAL && (layout != H5D_CHUNKED || !is_slow(dataset, made))) {
    H5Dwrite(dataset, type, memory, space, transfer, values);
  }
  H5Pclose(made);
}

void change_entry(hid_t file, Choices& choices, const std::string& path) {
  std::vector<double> values = numbers_of(file, path);
  if (values.empty()) return;
  double& value = values[choices.byte() % values.size()];
  value = choices.one_in(3) ? choices.number() : static_cast<double>(choices.integer());
  const hid_t dataset = H5Dopen2(file, path.c_str(), H5P_DEFAULT);
  write(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
  H5Dclose(dataset);
}

/// The same numbers, or fewer, or more of them, in another type, shape or layout.
void store_otherwise(hid_t file, Choices& choices, const std::string& path) {
  std::vector<double> values = numbers_of(file, path);
  if (values.empty()) return;
  if (choices.one_in(2)) {
    const double last = values.back();
    values.resize(choices.byte() % (values.size() + 3), last);
  }
  remove(file, path);
  const hid_t type = choose_type(choices);
  const hid_t space = choose_space(choices, values.size());
  const hid_t layout = choose_layout(choices, space, type);
  const hid_t dataset =
      H5Dcreate2(file, path.c_str(), type, space, H5P_DEFAULT, layout, H5P_DEFAULT);
  if (dataset >= 0) {
    if (H5Sget_simple_extent_npoints(space) == static_cast<hssize_t>(values.size())) {
      write(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
    }
    H5Dclose(dataset);
  }
  H5Pclose(layout);
  H5Sclose(space);
  H5Tclose(type);
}

/// Whether any bytes are a value of the type.
bool is_plain(hid_t type) {
  return H5Tdetect_class(type, H5T_VLEN) <= 0 && H5Tis_variable_str(type) <= 0 &&
         H5Tget_class(type) != H5T_REFERENCE;
}

/// Any dataset, filled with bytes, or with text of variable length, or not at all.
void store_anything(hid_t file, Choices& choices, const std::string& path) {
  remove(file, path);
  const hid_t type = choose_type(choices);
  const hid_t space = choose_space(choices, 1);
  const hid_t layout = choose_layout(choices, space, type);
  const hid_t dataset =
      H5Dcreate2(file, path.c_str(), type, space, H5P_DEFAULT, layout, H5P_DEFAULT);
  if (dataset >= 0) {
    const auto points = static_cast<double>(H5Sget_simple_extent_npoints(space));
    const auto bytes = points * static_cast<double>(H5Tget_size(type));
    if (bytes > 0 && bytes <= static_cast<double>(most_bytes) && choices.one_in(2)) {
      if (is_plain(type)) {
        std::string values(static_cast<std::size_t>(bytes), '\0');
        std::array<char, 8> pattern{};
        for (char& value : pattern) value = static_cast<char>(choices.byte());
        for (std::size_t k = 0; k < values.size(); ++k) values[k] = pattern[k % pattern.size()];
        write(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
      } else if (H5Tis_variable_str(type) > 0) {
        const std::vector<const char*> texts(static_cast<std::size_t>(points), "some\ntext");
        write(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, texts.data());
      }
    }
    H5Dclose(dataset);
  }
  H5Pclose(layout);
  H5Sclose(space);
  H5Tclose(type);
}

void add_attribute(hid_t file, Choices& choices, const std::string& path) {
  const hid_t type = choose_type(choices);
  const hid_t space = choose_space(choices, 1);
  const hid_t object = H5Oopen(file, path.c_str(), H5P_DEFAULT);
  constexpr hssize_t most_points = 1000;  // HDF5 would hold them all in memory
  if (object >= 0 && H5Sget_simple_extent_npoints(space) <= most_points) {
    static const char* const names[] = {"attribute", "error", "solver", "a\nb"};
    const char* const name = choices.one_of(names);
    if (H5Aexists(object, name) > 0) H5Adelete(object, name);
    const hid_t attribute = H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    if (attribute >= 0) {
      const auto value = choices.byte();
      const std::string bytes(static_cast<std::size_t>(most_points) * H5Tget_size(type),
                              static_cast<char>(value));
      if (is_plain(type)) H5Awrite(attribute, type, bytes.data());
      H5Aclose(attribute);
    }
  }
  if (object >= 0) H5Oclose(object);
  H5Sclose(space);
  H5Tclose(type);
}

void link(hid_t file, Choices& choices, const Base& base, const std::string& path) {
  const std::string target = choose_path(choices, base);
  const std::uint8_t how = choices.byte() % 8;
  if (how == 0) {  // to another place, what is there making room
    remove(file, path);
    H5Lmove(file, target.c_str(), file, path.c_str(), H5P_DEFAULT, H5P_DEFAULT);
  } else if (how < 3) {
    remove(file, path);
    H5Lcreate_hard(file, target.c_str(), file, path.c_str(), H5P_DEFAULT, H5P_DEFAULT);
  } else if (how < 5) {
    remove(file, path);
    H5Lcreate_soft(("/" + target).c_str(), file, path.c_str(), H5P_DEFAULT, H5P_DEFAULT);
  } else if (how == 5) {
    remove(file, path);
    static const char* const files[] = {"changed.hdf5", "nothing.hdf5", "/dev/null", ""};
    H5Lcreate_external(choices.one_of(files), ("/" + target).c_str(), file, path.c_str(),
                       H5P_DEFAULT, H5P_DEFAULT);
  } else if (how == 6) {
    remove(file, path);
    const char* const targets[] = {"/", ".", "..", "/fclib_local", path.c_str()};
    H5Lcreate_soft(choices.one_of(targets), file, path.c_str(), H5P_DEFAULT, H5P_DEFAULT);
  } else {  // a group into itself
    remove(file, path);
    H5Lcreate_hard(file, "/", file, path.c_str(), H5P_DEFAULT, H5P_DEFAULT);
  }
}

void put_other_kind(hid_t file, Choices& choices, const std::string& path) {
  remove(file, path);
  if (choices.one_in(2)) {
    const hid_t type = choose_type(choices);
    H5Tcommit2(file, path.c_str(), type, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Tclose(type);
  } else {
    H5Gclose(H5Gcreate2(file, path.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  }
}

void change(hid_t file, Choices& choices, const Base& base) {
  const std::uint8_t what = choices.byte() % 16;
  const std::string path = choose_path(choices, base);
  if (what < 6) {
    change_entry(file, choices, path);
  } else if (what < 9) {
    store_otherwise(file, choices, path);
  } else if (what < 11) {
    store_anything(file, choices, path);
  } else if (what == 11) {
    remove(file, path);
  } else if (what < 14) {
    link(file, choices, base, path);
  } else if (what == 14) {
    put_other_kind(file, choices, path);
  } else {
    add_attribute(file, choices, path);
  }
}

void run(std::string_view bytes) {
  static const std::string path = (scratch() / "changed.hdf5").string();
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  Choices choices(bytes);
  const Base& base = choices.one_of(bases());
  put_file(path, base.bytes);
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  require(file >= 0, "the file can be opened");
  constexpr int most_changes = 16;
  for (int k = 0; k < most_changes && !choices.empty(); ++k) change(file, choices, base);
  require(H5Fclose(file) >= 0, "the changed file can be closed");
  require(H5Fget_obj_count(H5F_OBJ_ALL, H5F_OBJ_ALL) == 0, "the changes leave nothing open");
  read_all(path, writes_too(bytes));
  require(H5Fget_obj_count(H5F_OBJ_ALL, H5F_OBJ_ALL) == 0, "the readers leave nothing open");
}

/// Bytes of a plain generator: each makes a few changes.
std::vector<Input> seeds() {
  std::vector<Input> result;
  std::uint32_t state = 1;
  constexpr int count = 300;
  for (int k = 0; k < count; ++k) {
    std::string bytes;
    for (int length = 0; length < 4 + k % 60; ++length) {
      state = state * 1664525 + 1013904223;
      bytes += static_cast<char>(state >> 24);
    }
    result.push_back({std::to_string(k), bytes});
  }
  return result;
}

}  // namespace

const Target hdf5_objects{.name = "hdf5_objects", .run = run, .seeds = seeds};

}  // namespace fclib::fuzz
