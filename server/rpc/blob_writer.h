#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/io/digest.h"
#include "server/jobs/locked_file.h"

namespace pepeseg {

// The one writer of a blob's beginning. What it has committed is on the disk, and known to be
// right by whoever goes on after it; it commits every 32 MiB and where it is destroyed. For one
// thread at a time; calls block.
class BlobWriter {
 public:
  struct Target {
    std::filesystem::path partial;  // the beginning
    std::filesystem::path blob;     // the whole, in a folder that is there
    std::string sha256;
    int64_t size = 0;  // declared
  };
  // With what an earlier writer has committed; only Start comes next.
  BlobWriter(LockedFile file, Target target);
  ~BlobWriter();
  BlobWriter(const BlobWriter&) = delete;
  BlobWriter& operator=(const BlobWriter&) = delete;

  int64_t committed() const { return committed_; }
  // 0: anew. OUT_OF_RANGE: neither that nor what is committed, of which everything is hashed again:
  // Rehash, in turns, until it is ready.
  absl::Status Start(int64_t offset);
  bool ready() const { return hashed_ == written_; }
  absl::Status Rehash();

  // INVALID_ARGUMENT when it is more than was declared; RESOURCE_EXHAUSTED: the disk is full.
  absl::Status Append(std::string_view bytes);
  // Makes the blob of it; nothing may come after. INVALID_ARGUMENT when it is less than declared;
  // DATA_LOSS when the digest is another: then nothing of it is kept.
  absl::Status Commit();

 private:
  absl::Status Discard();
  absl::Status Sync();
  // What is written is committed.
  absl::Status Record();

  LockedFile file_;
  const Target target_;
  Sha256 digest_;
  bool ended_ = false;  // nothing is left to be kept
  int64_t committed_ = 0, written_ = 0, hashed_ = 0;
};

// Bytes of a beginning that are committed; 0: none.
int64_t CommittedBytes(const std::filesystem::path& partial);

}  // namespace pepeseg
