#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/io/atomic_file.h"
#include "core/io/digest.h"

namespace pepeseg {

// The bytes of uploaded files, by digest: a blob is there as a whole or not at all, also after a
// power cut, and never changes. Thread safe; a Writer is for one thread at a time. Calls block.
class BlobStore {
 public:
  // Makes the folder, and clears what writers of an earlier process left behind.
  static absl::StatusOr<std::unique_ptr<BlobStore>> Open(const std::filesystem::path& data);

  // `sha256`: 64 lower-case hex digits.
  bool Has(const std::string& sha256, int64_t size) const;
  std::filesystem::path Path(const std::string& sha256) const;

  // A blob on its way. Destroyed without Commit() it leaves nothing.
  class Writer {
   public:
    // INVALID_ARGUMENT when it is more than was declared; RESOURCE_EXHAUSTED: the disk is full.
    absl::Status Append(std::string_view bytes);
    // INVALID_ARGUMENT when it is less than declared; DATA_LOSS when the digest is another.
    absl::Status Commit();

   private:
    friend class BlobStore;
    Writer(AtomicFile file, std::string sha256, int64_t size)
        : file_(std::move(file)), sha256_(std::move(sha256)), size_(size) {}

    AtomicFile file_;
    Sha256 digest_;
    std::string sha256_;
    int64_t size_;
    int64_t written_ = 0;
  };
  absl::StatusOr<std::unique_ptr<Writer>> Begin(const std::string& sha256, int64_t size);

 private:
  explicit BlobStore(std::filesystem::path data) : data_(std::move(data)) {}
  const std::filesystem::path data_;
};

}  // namespace pepeseg
