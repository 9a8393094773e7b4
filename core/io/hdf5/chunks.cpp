#include "io/hdf5/chunks.hpp"

#include "io/hdf5/handles.hpp"

namespace fclib::hdf5 {

Packing packing_of(hid_t properties) {
  hsize_t chunk = 0;
  if (H5Pget_layout(properties) != H5D_CHUNKED || H5Pget_chunk(properties, 1, &chunk) != 1) {
    return {};
  }
  const auto filter = [&](int k) {
    std::size_t values = 0;
    return H5Pget_filter2(properties, static_cast<unsigned>(k), nullptr, &values, nullptr, 0,
                          nullptr, nullptr);
  };
  const int filters = H5Pget_nfilters(properties);
  const bool shuffled = filters == 2 && filter(0) == H5Z_FILTER_SHUFFLE;
  if (filters != (shuffled ? 2 : 1) || filter(filters - 1) != H5Z_FILTER_DEFLATE) return {};
  return {.chunk = chunk, .shuffled = shuffled};
}

}  // namespace fclib::hdf5

#ifdef FCLIB_LIBDEFLATE

#include <libdeflate.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <memory>

namespace fclib::hdf5 {

namespace {

constexpr bool little_endian = std::endian::native == std::endian::little;
/// As many numbers are shuffled at once as a word has bytes.
constexpr std::size_t word = sizeof(std::uint64_t);

/// The compressor of a level. It is kept, since it takes longer to make than a small array to pack.
libdeflate_compressor* compressor_of(int level) {
  struct Free {
    void operator()(libdeflate_compressor* compressor) const {
      libdeflate_free_compressor(compressor);
    }
  };
  static std::array<std::unique_ptr<libdeflate_compressor, Free>, 10> made;
  auto& compressor = made.at(static_cast<std::size_t>(level));
  if (!compressor) compressor.reset(libdeflate_alloc_compressor(level));
  return compressor.get();
}

libdeflate_decompressor* decompressor() {
  struct Free {
    void operator()(libdeflate_decompressor* made) const { libdeflate_free_decompressor(made); }
  };
  static const std::unique_ptr<libdeflate_decompressor, Free> made(libdeflate_alloc_decompressor());
  return made.get();
}

/// Row k of the eight becomes column k, byte by byte. H. S. Warren, Hacker's Delight, 2nd ed., 7-3.
void transpose(std::array<std::uint64_t, word>& rows) {
  constexpr std::array<std::uint64_t, 3> masks{0x00FF00FF00FF00FF, 0x0000FFFF0000FFFF,
                                               0x00000000FFFFFFFF};
  for (unsigned stage = 0; stage < masks.size(); ++stage) {
    const unsigned apart = 1U << stage;
    for (unsigned k = 0; k < word; ++k) {
      if ((k & apart) != 0) continue;
      const std::uint64_t swapped = ((rows[k] >> (8 * apart)) ^ rows[k + apart]) & masks[stage];
      rows[k + apart] ^= swapped;
      rows[k] ^= swapped << (8 * apart);
    }
  }
}

/// The first bytes of all numbers, then the second ones, and so on: the shuffle of HDF5.
template <std::size_t width>
void shuffle(const char* in, char* out, std::size_t size) {
  std::size_t k = 0;
  for (; k + word <= size; k += word) {
    std::array<std::uint64_t, word> rows{};
    for (std::size_t j = 0; j < word; ++j) std::memcpy(&rows[j], in + width * (k + j), width);
    transpose(rows);
    for (std::size_t b = 0; b < width; ++b) std::memcpy(out + b * size + k, &rows[b], word);
  }
  for (; k < size; ++k) {
    for (std::size_t b = 0; b < width; ++b) out[b * size + k] = in[width * k + b];
  }
}

/// ... and back.
template <std::size_t width>
void unshuffle(const char* in, char* out, std::size_t size) {
  std::size_t k = 0;
  for (; k + word <= size; k += word) {
    std::array<std::uint64_t, word> rows{};
    for (std::size_t b = 0; b < width; ++b) std::memcpy(&rows[b], in + b * size + k, word);
    transpose(rows);
    for (std::size_t j = 0; j < word; ++j) std::memcpy(out + width * (k + j), &rows[j], width);
  }
  for (; k < size; ++k) {
    for (std::size_t b = 0; b < width; ++b) out[width * k + b] = in[b * size + k];
  }
}

bool same_type(hid_t dataset, hid_t memory) {
  const Handle type(H5Dget_type(dataset), H5Tclose);
  return H5Tequal(type.id(), memory) > 0;
}

std::unique_ptr<char[]> room(std::size_t bytes) {
  return std::make_unique_for_overwrite<char[]>(bytes);
}

/// The mask of a chunk that deflate does not shrink: the chunk is stored without it.
constexpr std::uint32_t without_deflate(bool shuffled) { return shuffled ? 2 : 1; }

}  // namespace

bool pack(const Bytes& numbers, const Packing& packing, int level, const TakeChunk& take) {
  const auto [data, size, width] = numbers;
  libdeflate_compressor* const compressor = compressor_of(level);
  if (!little_endian || compressor == nullptr || (width != 4 && width != 8)) return false;
  const std::size_t bytes = packing.chunk * width;
  const auto edge = room(size % packing.chunk == 0 ? 0 : bytes);
  const auto shuffled = room(packing.shuffled ? bytes : 0);
  const auto deflated = room(bytes);
  for (std::size_t at = 0; at < size; at += packing.chunk) {
    const char* chunk = data + at * width;
    if (size - at < packing.chunk) {  // HDF5 has only whole chunks
      std::memcpy(edge.get(), chunk, (size - at) * width);
      std::memset(edge.get() + (size - at) * width, 0, bytes - (size - at) * width);
      chunk = edge.get();
    }
    if (packing.shuffled) {
      (width == 8 ? shuffle<8> : shuffle<4>)(chunk, shuffled.get(), packing.chunk);
      chunk = shuffled.get();
    }
    const std::size_t taken =
        libdeflate_zlib_compress(compressor, chunk, bytes, deflated.get(), bytes - 1);
    if (taken > 0) {
      take({deflated.get(), taken}, 0);
    } else {
      take({chunk, bytes}, without_deflate(packing.shuffled));
    }
  }
  return true;
}

bool read_chunks(hid_t dataset, const Packing& packing, hid_t memory, std::size_t size,
                 void* values) {
  if (packing.chunk == 0) return false;
  const std::size_t width = H5Tget_size(memory);
  if (!little_endian || (width != 4 && width != 8) || !same_type(dataset, memory) ||
      decompressor() == nullptr) {
    return false;
  }
  const std::size_t bytes = packing.chunk * width;
  const auto packed = room(bytes);
  const auto unpacked = room(bytes);
  const auto edge = room(size % packing.chunk == 0 ? 0 : bytes);
  for (std::size_t at = 0; at < size; at += packing.chunk) {
    const hsize_t offset = at;
    hsize_t stored = 0;
    std::uint32_t mask = 0;
    if (H5Dget_chunk_storage_size(dataset, &offset, &stored) < 0 || stored == 0 || stored > bytes ||
        H5Dread_chunk(dataset, H5P_DEFAULT, &offset, &mask, packed.get()) < 0) {
      return false;
    }
    const char* chunk = packed.get();
    if (mask == without_deflate(packing.shuffled)) {
      if (stored != bytes) return false;
    } else {
      if (mask != 0 ||
          libdeflate_zlib_decompress(decompressor(), packed.get(), stored, unpacked.get(), bytes,
                                     nullptr) != LIBDEFLATE_SUCCESS) {
        return false;
      }
      chunk = unpacked.get();
    }
    const std::size_t count = std::min(packing.chunk, size - at);
    char* target = static_cast<char*>(values) + at * width;
    if (!packing.shuffled) {
      std::memcpy(target, chunk, count * width);
    } else if (count == packing.chunk) {
      (width == 8 ? unshuffle<8> : unshuffle<4>)(chunk, target, count);
    } else {
      (width == 8 ? unshuffle<8> : unshuffle<4>)(chunk, edge.get(), packing.chunk);
      std::memcpy(target, edge.get(), count * width);
    }
  }
  return true;
}

}  // namespace fclib::hdf5

#else

namespace fclib::hdf5 {

bool pack(const Bytes&, const Packing&, int, const TakeChunk&) { return false; }
bool read_chunks(hid_t, const Packing&, hid_t, std::size_t, void*) { return false; }

}  // namespace fclib::hdf5

#endif
