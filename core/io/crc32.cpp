#include "io/crc32.hpp"

namespace fclib {

namespace {

constexpr std::uint32_t polynomial = 0xEDB88320U;  // of the standard, its lowest bit first
constexpr std::size_t slices = 8;                  // bytes that are taken at once

using Table = std::array<std::uint32_t, 256>;

/// Table k has what a byte does to the checksum k bytes later.
constexpr std::array<Table, slices> tables = [] {
  std::array<Table, slices> made{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t rest = byte;
    for (int bit = 0; bit < 8; ++bit) rest = (rest >> 1) ^ ((rest & 1) != 0 ? polynomial : 0);
    made[0][byte] = rest;
  }
  for (std::size_t k = 1; k < slices; ++k) {
    for (std::size_t byte = 0; byte < 256; ++byte) {
      const std::uint32_t rest = made[k - 1][byte];
      made[k][byte] = (rest >> 8) ^ made[0][rest & 255];
    }
  }
  return made;
}();

}  // namespace

std::uint32_t crc32(std::span<const char> bytes, std::uint32_t before) {
  std::uint32_t rest = ~before;
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(bytes[k]); };
  std::size_t at = 0;
  for (; bytes.size() - at >= slices; at += slices) {
    std::uint32_t next = 0;
    for (std::size_t k = 0; k < slices; ++k) {
      const std::uint32_t old = k < sizeof rest ? rest >> (8 * k) : 0;
      next ^= tables[slices - 1 - k][(old ^ byte(at + k)) & 255];
    }
    rest = next;
  }
  for (; at < bytes.size(); ++at) rest = (rest >> 8) ^ tables[0][(rest ^ byte(at)) & 255];
  return ~rest;
}

}  // namespace fclib
