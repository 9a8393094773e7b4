#include "io/hdf5/transaction.hpp"

#include <sys/mman.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string_view>
#include <utility>

#include "io/hdf5/write.hpp"
#include "io/replace_file.hpp"
#include "version.hpp"

namespace fclib::hdf5 {

namespace {

namespace fs = std::filesystem;

/// Entries under a node of an index, halved: few datasets have more than one chunk. With 1 an index
/// gets a level for each entry, and HDF5 fails, or ends its process, beyond 255.
constexpr unsigned index_rank = 2;

/// Memory from malloc of this size that goes on from `memory`; a large one in large pages, where
/// the system has them: to touch it for the first time is most of what a large write takes.
void* grown(void* memory, std::size_t size) {
  void* const result = std::realloc(memory, size);
#ifdef MADV_HUGEPAGE
  constexpr std::size_t page = std::size_t{1} << 21;
  if (result != nullptr && size >= 2 * page) {
    const auto begin = reinterpret_cast<std::uintptr_t>(result);
    const std::uintptr_t first = (begin + page - 1) / page * page;
    const std::uintptr_t last = (begin + size) / page * page;
    ::madvise(static_cast<char*>(result) + (first - begin), last - first, MADV_HUGEPAGE);
  }
#endif
  return result;
}

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
      return grown(nullptr, size);
    };
    callbacks.image_realloc = [](void* memory, std::size_t size, H5FD_file_image_op_t, void*) {
      return grown(memory, size);
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
  explicit MemoryFile(std::string bytes)
      : access_(core_driver(image_)), file_(open(access_.id(), std::move(bytes))) {}

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
    constexpr std::size_t increment = std::size_t{1} << 16;
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
  static Handle open(hid_t access, std::string bytes) {
    check(H5Pset_file_image(access, bytes.data(), bytes.size()), "");
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

MemoryFile copy_of(const std::string& path) {
  try {
    return MemoryFile(read_file(path));
  } catch (const Error&) {
    const Handle file = open_file(path);  // says best what is wrong with it
    throw;
  }
}

void require_level(int compression) {
  if (compression < compress_cheaply || compression > 9) {
    throw Error(ErrorKind::option,
                "is " + std::to_string(compression) +
                    ", but must be 0 to 9, or -1 (only what packs at once)",
                "the compression level");
  }
}

}  // namespace

void change_file(const std::string& path, Start start, int compression,
                 const std::function<void(const Target& root)>& change) {
  require_level(compression);
  const Session session;
  in_file(path, [&] {
    const Turn turn(path);
    std::error_code error;
    finish_rewrite(path);
    const bool existing =
        start == Start::existing || (start == Start::existing_or_empty && fs::exists(path, error));
    MemoryFile file = existing ? copy_of(path) : MemoryFile();
    std::optional<MemoryFile> scratch;
    const Style style(compression, [&] {
      if (!scratch) scratch.emplace("scratch");
      return scratch->id();
    });
    const Target root{{file.id(), "/"}, &style};
    if (!existing) {
      write_text_attribute(root, "format", format_version);
      write_text_attribute(root, "generator", "fclib " + std::string(version));
    }
    change(root);
    replace_file(path, file.finish());
  });
}

}  // namespace fclib::hdf5
