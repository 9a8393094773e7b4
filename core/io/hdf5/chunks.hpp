// Chunks of numbers, packed and unpacked by libdeflate where that is there: the same filters and
// the same format as HDF5's own, which go by zlib, in a part of their time.
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
  std::size_t size;   ///< numbers
  std::size_t width;  ///< bytes of each
};

/// How a dataset of one dimension is packed: by deflate, shuffled before or not.
struct Packing {
  std::size_t chunk = 0;  ///< numbers in a chunk; 0: it is not, or by other filters
  bool shuffled = false;
};

/// The packing that a dataset's properties ask for.
Packing packing_of(hid_t properties);

/// Is given a chunk, and the mask of the filters that were passed over.
using TakeChunk = std::function<void(std::string_view bytes, std::uint32_t mask)>;

/// Packs numbers, chunk by chunk, at a level of deflate from 1 to 9; false: it is left to HDF5.
/// Under the library's lock.
bool pack(const Bytes& numbers, const Packing& packing, int level, const TakeChunk& take);

/// Reads all of a dataset of so many numbers of the type `memory`; false: it is left to HDF5, which
/// knows other layouts, and says what is wrong with a damaged file. Under the library's lock.
bool read_chunks(hid_t dataset, const Packing& packing, hid_t memory, std::size_t size,
                 void* values);

}  // namespace fclib::hdf5
