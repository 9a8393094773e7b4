// Chunks of numbers, packed and unpacked by libdeflate if the build has it. The filters and the
// format are HDF5's own, which use zlib and take several times as long.
#pragma once

#include <hdf5.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string_view>

namespace fclib::hdf5 {

/// Numbers in memory, in little endian as the file has them.
struct Bytes {
  const char* data;
  std::size_t size;   ///< how many numbers
  std::size_t width;  ///< bytes of each number
};

/// How a dataset of one dimension is packed: by deflate, with or without shuffling first.
struct Packing {
  std::size_t chunk = 0;  ///< numbers in a chunk; 0: not packed, or by other filters
  bool shuffled = false;
};

/// The packing that the properties of a dataset ask for.
Packing packing_of(hid_t properties);

/// Gets a chunk, and the mask of the filters that were skipped.
using TakeChunk = std::function<void(std::string_view bytes, std::uint32_t mask)>;

/// Packs numbers chunk by chunk, at a level of deflate from 1 to 9. Returns false if that is left
/// to HDF5. The caller holds the library's lock.
bool pack(const Bytes& numbers, const Packing& packing, int level, const TakeChunk& take);

/// Reads all of a dataset of so many numbers of the type `memory`. Returns false if that is left to
/// HDF5, which knows other layouts and reports what is wrong with a damaged file. The caller holds
/// the library's lock.
bool read_chunks(hid_t dataset, const Packing& packing, hid_t memory, std::size_t size,
                 void* values);

}  // namespace fclib::hdf5
