#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace pepeseg::client {

struct FileDigest {
  int64_t size = 0;    // bytes
  std::string sha256;  // 64 lower-case hex digits
};

// Reads a file and returns its size and digest. LocalFileError (file_bytes.h): the file cannot be
// opened, or not be read to its end.
absl::StatusOr<FileDigest> DigestFile(const std::filesystem::path& path);

// SHA-256 of bytes that arrive in pieces.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void Add(std::string_view bytes);
  // Returns 64 lower-case hex digits. Call it once, after the last Add.
  std::string Finish();

 private:
  void* context_;  // EVP_MD_CTX; void keeps OpenSSL out of this header
};

}  // namespace pepeseg::client
