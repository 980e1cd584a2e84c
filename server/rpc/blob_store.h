#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/rpc/sha256.h"

namespace pepeseg {

// The bytes of uploaded files, by digest: a blob is there as a whole or not at all, also after a
// power cut, and never changes. Thread safe; a Writer is for one thread at a time. Calls block.
class BlobStore {
 public:
  // Makes the folders, and clears what writers of an earlier process left behind.
  static absl::StatusOr<std::unique_ptr<BlobStore>> Open(const std::filesystem::path& data);

  // `sha256`: 64 lower-case hex digits.
  bool Has(const std::string& sha256, int64_t size) const;
  std::filesystem::path Path(const std::string& sha256) const;

  // A blob on its way. Destroyed without Commit() it leaves nothing.
  class Writer {
   public:
    ~Writer();
    Writer(const Writer&) = delete;
    Writer& operator=(const Writer&) = delete;

    // INVALID_ARGUMENT when it is more than was declared; RESOURCE_EXHAUSTED: the disk is full.
    absl::Status Append(std::string_view bytes);
    // INVALID_ARGUMENT when it is less than declared; DATA_LOSS when the digest is another.
    absl::Status Commit();

   private:
    friend class BlobStore;
    Writer() = default;

    std::filesystem::path incoming_;
    std::filesystem::path target_;
    std::string sha256_;
    int64_t size_ = 0;
    int64_t written_ = 0;
    int descriptor_ = -1;
    Sha256 digest_;
  };
  absl::StatusOr<std::unique_ptr<Writer>> Begin(const std::string& sha256, int64_t size);

 private:
  explicit BlobStore(std::filesystem::path data) : data_(std::move(data)) {}
  const std::filesystem::path data_;
};

}  // namespace pepeseg
