#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace pepeseg::client {

// CRC-32C (Castagnoli), as the contract wants it of each chunk.
uint32_t Crc32c(std::string_view bytes);

struct FileDigest {
  int64_t size = 0;    // bytes
  std::string sha256;  // 64 lower-case hex digits
};

// NOT_FOUND when the file cannot be opened, DATA_LOSS when it cannot be read to its end.
absl::StatusOr<FileDigest> DigestFile(const std::filesystem::path& path);

// Of bytes that come piece by piece.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void Add(std::string_view bytes);
  // Hex; call once, last.
  std::string Finish();

 private:
  void* context_;  // EVP_MD_CTX, kept out of this header
};

}  // namespace pepeseg::client
