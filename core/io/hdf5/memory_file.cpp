#include "io/hdf5/memory_file.hpp"

#if H5_VERSION_GE(1, 13, 0)
#include <H5FDdevelop.h>
#endif

#include <algorithm>
#include <array>
#include <cstring>
#include <iterator>
#include <limits>

#include "io/hdf5/write_objects.hpp"

namespace fclib::hdf5 {

namespace {

constexpr std::uint64_t page_size = std::uint64_t{1} << 16;
/// Fewer bytes are copied: that is faster than a reference to them.
constexpr std::size_t least_loan = std::size_t{1} << 14;
/// A damaged file: more zeros in it were never written.
constexpr std::uint64_t most_unwritten = std::uint64_t{1} << 26;

constexpr std::array<char, page_size> zeros{};

/// Half the entries under a node of an index. Few datasets have more than one chunk. With 1, an
/// index gets a level for each entry, and HDF5 fails, or ends its process, beyond 255.
constexpr unsigned index_rank = 2;

}  // namespace

// ---- the bytes

Pieces::Pieces(std::string bytes) : first_(std::move(bytes)), end_(first_.size()) {
  if (!first_.empty()) loans_[0] = {end_, first_.data()};
}

void Pieces::lend(const void* data, std::size_t size) {
  const auto* begin = static_cast<const char*>(data);
  if (size >= least_loan) lent_.emplace_back(begin, begin + size);
}

bool Pieces::is_lent(const char* data, std::size_t size) const {
  if (size < least_loan) return false;
  return std::any_of(lent_.begin(), lent_.end(), [&](const auto& range) {
    return data >= range.first && data + size <= range.second;
  });
}

void Pieces::end_loans(std::uint64_t begin, std::uint64_t end) {
  auto loan = loans_.lower_bound(begin);
  if (loan != loans_.begin() && std::prev(loan)->second.end > begin) --loan;
  while (loan != loans_.end() && loan->first < end) {
    const auto [from, old] = *loan;
    loan = loans_.erase(loan);
    if (from < begin) loans_[from] = {begin, old.data};
    if (old.end > end) {
      loans_[end] = {old.end, old.data + (end - from)};
      return;
    }
  }
}

const char* Pieces::page(std::uint64_t number) const {
  const auto found = pages_.find(number);
  return found != pages_.end() ? found->second.get() : zeros.data();
}

void Pieces::write(std::uint64_t at, const char* data, std::size_t size) {
  if (size == 0) return;
  const std::uint64_t end = at + size;
  end_loans(at, end);
  end_ = std::max(end_, end);
  if (is_lent(data, size)) {
    loans_[at] = {end, data};
    return;
  }
  while (at < end) {
    auto& own = pages_[at / page_size];
    if (!own) own = std::make_unique<char[]>(page_size);
    const std::uint64_t offset = at % page_size;
    const std::uint64_t part = std::min(page_size - offset, end - at);
    std::memcpy(own.get() + offset, data, part);
    data += part;
    at += part;
  }
}

void Pieces::read(std::uint64_t at, char* data, std::size_t size) const {
  const std::uint64_t end = at + size;
  for (std::uint64_t from = at; from < end;) {
    const std::uint64_t offset = from % page_size;
    const std::uint64_t part = std::min(page_size - offset, end - from);
    std::memcpy(data + (from - at), page(from / page_size) + offset, part);
    from += part;
  }
  auto loan = loans_.lower_bound(at);
  if (loan != loans_.begin() && std::prev(loan)->second.end > at) --loan;
  for (; loan != loans_.end() && loan->first < end; ++loan) {
    const std::uint64_t from = std::max(at, loan->first);
    const std::uint64_t to = std::min(end, loan->second.end);
    std::memcpy(data + (from - at), loan->second.data + (from - loan->first), to - from);
  }
}

std::vector<std::string_view> Pieces::all(std::uint64_t size) const {
  std::vector<std::string_view> result;
  auto loan = loans_.begin();
  for (std::uint64_t at = 0; at < size;) {
    if (loan != loans_.end() && loan->first <= at) {
      const std::uint64_t end = std::min(size, loan->second.end);
      result.emplace_back(loan->second.data, end - at);
      at = end;
      ++loan;
      continue;
    }
    const std::uint64_t next = loan != loans_.end() ? loan->first : size;
    const std::uint64_t offset = at % page_size;
    const std::uint64_t end = std::min({size, next, at - offset + page_size});
    result.emplace_back(page(at / page_size) + offset, end - at);
    at = end;
  }
  return result;
}

// ---- HDF5's driver over them

namespace {

/// A file as the driver has it open.
struct OpenFile {
  H5FD_t known_to_hdf5;  // first: HDF5 knows the file by it
  MemoryFile::Contents* contents;
};

MemoryFile::Contents& contents_of(const H5FD_t* file) {
  return *reinterpret_cast<const OpenFile*>(file)->contents;
}

/// Without memory, it fails in HDF5.
template <class Body>
herr_t guarded(const Body& body) {
  try {
    body();
    return 0;
  } catch (const std::bad_alloc&) {
    return -1;
  }
}

H5FD_t* open_contents(const char*, unsigned, hid_t access, haddr_t) {
  const auto* given = static_cast<MemoryFile::Contents* const*>(H5Pget_driver_info(access));
  if (given == nullptr) return nullptr;
  auto* file = new (std::nothrow) OpenFile{};
  if (file == nullptr) return nullptr;
  file->contents = *given;
  file->contents->size = 0;  // HDF5 sets the size
  return &file->known_to_hdf5;
}

H5FD_class_t driver_class() {
  H5FD_class_t driver{};
#if H5_VERSION_GE(1, 14, 0)
  driver.version = H5FD_CLASS_VERSION;
  driver.value = 511;  // a number that is assigned to nobody
#endif
  driver.name = "fclib_memory";
  driver.maxaddr = std::numeric_limits<haddr_t>::max() / 2;
  driver.fc_degree = H5F_CLOSE_WEAK;
  driver.fapl_size = sizeof(MemoryFile::Contents*);
  driver.open = open_contents;
  driver.close = [](H5FD_t* file) -> herr_t {
    delete reinterpret_cast<OpenFile*>(file);
    return 0;
  };
  // as in HDF5's own driver of files in memory
  driver.query = [](const H5FD_t*, unsigned long* flags) -> herr_t {
    *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
             H5FD_FEAT_AGGREGATE_SMALLDATA;
    return 0;
  };
  driver.get_eoa = [](const H5FD_t* file, H5FD_mem_t) -> haddr_t { return contents_of(file).size; };
  driver.set_eoa = [](H5FD_t* file, H5FD_mem_t, haddr_t size) -> herr_t {
    contents_of(file).size = size;
    return 0;
  };
  driver.get_eof = [](const H5FD_t* file, H5FD_mem_t) -> haddr_t {
    return contents_of(file).pieces.end();
  };
  driver.read = [](H5FD_t* file, H5FD_mem_t, hid_t, haddr_t at, std::size_t size, void* data) {
    return guarded([&] { contents_of(file).pieces.read(at, static_cast<char*>(data), size); });
  };
  driver.write = [](H5FD_t* file, H5FD_mem_t, hid_t, haddr_t at, std::size_t size,
                    const void* data) {
    return guarded(
        [&] { contents_of(file).pieces.write(at, static_cast<const char*>(data), size); });
  };
  constexpr H5FD_mem_t map[] = H5FD_FLMAP_DICHOTOMY;
  std::copy(std::begin(map), std::end(map), std::begin(driver.fl_map));
  return driver;
}

/// Registered again for each file: a host may close all of HDF5 in between.
Handle registered_driver() {
  const H5FD_class_t driver = driver_class();
  Handle result(H5FDregister(&driver), H5FDunregister);
  if (!result.ok()) fail("", "cannot be held in memory by HDF5");
  return result;
}

/// Headers of HDF5 1.8 from here on: they are smaller than the older ones. If the file itself were
/// created with them, it would contain the time of its creation.
void use_small_headers(hid_t file) {
  check(H5Fset_libver_bounds(file, H5F_LIBVER_V18, H5F_LIBVER_LATEST), "");
}

}  // namespace

MemoryFile::MemoryFile() : contents_(std::make_unique<Contents>()), driver_(registered_driver()) {
  const Handle properties(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
  keep_small(properties.id());
  check(H5Pset_istore_k(properties.id(), index_rank), "");
  check(H5Pset_sym_k(properties.id(), index_rank, 1), "");
  check(H5Pset_local_heap_size_hint(properties.id(), 64), "");
  file_.emplace(H5Fcreate("new", H5F_ACC_TRUNC, properties.id(), access().id()), H5Fclose);
  if (!file_->ok()) fail("", "cannot be created by HDF5");
  use_small_headers(file_->id());
}

MemoryFile::MemoryFile(std::string bytes)
    : contents_(new Contents{Pieces(std::move(bytes))}), driver_(registered_driver()) {
  file_.emplace(H5Fopen("image", H5F_ACC_RDWR, access().id()), H5Fclose);
  if (!file_->ok()) fail("", "cannot be opened by HDF5 (the file is damaged or cut short)");
  use_small_headers(file_->id());
}

Handle MemoryFile::access() const {
  Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  Contents* const contents = contents_.get();
  check(H5Pset_driver(access.id(), driver_.id(), static_cast<const void*>(&contents)), "");
  // keep no room for later members
  check(H5Pset_meta_block_size(access.id(), 0), "");
  check(H5Pset_small_data_block_size(access.id(), 0), "");
  return access;
}

std::vector<std::string_view> MemoryFile::finish() {
  check(H5Fflush(file_->id(), H5F_SCOPE_LOCAL), "");
  file_.reset();
  const auto& [pieces, size] = *contents_;
  if (size == 0 || size > pieces.end() + most_unwritten) {
    fail("", "cannot be put together by HDF5");
  }
  return pieces.all(size);
}

}  // namespace fclib::hdf5
