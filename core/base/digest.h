#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace pepeseg {

// Computes the SHA-256 of bytes that arrive piece by piece.
class Sha256 {
 public:
  Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;
  ~Sha256();

  void Add(std::string_view bytes);
  void Add(std::span<const uint8_t> bytes);
  // Returns the digest as 64 lower-case hexadecimal digits. No other call may follow it.
  std::string Hex();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Return the same digits for bytes in memory and for a file. NOT_FOUND: there is no such file.
// INTERNAL: it cannot be read.
std::string Sha256Hex(std::string_view bytes);
absl::StatusOr<std::string> Sha256OfFile(const std::filesystem::path& path);

// Returns the CRC-32C (Castagnoli polynomial, as in iSCSI and in storage services over gRPC) of
// `bytes`. To compute it piece by piece, pass the CRC of the preceding bytes as `crc`; 0: none.
uint32_t Crc32c(std::span<const uint8_t> bytes, uint32_t crc = 0);
uint32_t Crc32c(const std::string& bytes, uint32_t crc = 0);

}  // namespace pepeseg
