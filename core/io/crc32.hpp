// The checksum CRC-32 of zlib, PNG and Ethernet: it tells each damage within 32 bits, and misses
// one in 4e9 of the others.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

namespace fclib {

/// The checksum of bytes that follow those of `before`.
std::uint32_t crc32(std::span<const char> bytes, std::uint32_t before = 0);

/// The same of an array of numbers as files have them, in little endian.
template <class Values>
std::uint32_t crc32_of(const Values& values, std::uint32_t before = 0) {
  using Number = std::remove_cvref_t<decltype(*values.data())>;
  const std::span<const Number> numbers(values.data(), static_cast<std::size_t>(values.size()));
  if constexpr (std::endian::native == std::endian::little || sizeof(Number) == 1) {
    return crc32({reinterpret_cast<const char*>(numbers.data()), numbers.size_bytes()}, before);
  } else {
    for (const Number& number : numbers) {
      std::array<char, sizeof(Number)> bytes;
      std::memcpy(bytes.data(), &number, sizeof(Number));
      std::reverse(bytes.begin(), bytes.end());
      before = crc32(bytes, before);
    }
    return before;
  }
}

}  // namespace fclib
