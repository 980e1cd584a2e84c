#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/digest.h"
#include "server/data/locked_file.h"

namespace pepeseg {

// The one writer of a blob's beginning. What it has committed is on the disk, and known to be
// right by whoever goes on after it; it commits every 32 MiB and where it is destroyed. Whole, its
// bytes are checked (Finish), synced and published under the blob's name, on their own (Commit) or
// with other files' (WriteGroup). For one thread at a time; calls block.
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
  // Checks the whole; only Sync, Publish and Commit may come after. INVALID_ARGUMENT when it is
  // less than declared; DATA_LOSS when the digest is another: then nothing of it is kept.
  absl::Status Finish();
  // Makes what is written durable. After an error nothing of what was not committed is kept.
  absl::Status Sync();
  // Gives the finished and synced file the blob's name, which is durable once the folder is synced.
  absl::Status Publish();
  // Finish, Sync, Publish, and a sync of the folder.
  absl::Status Commit();

  int descriptor() const { return file_.descriptor(); }
  int64_t size() const { return target_.size; }
  const std::filesystem::path& blob() const { return target_.blob; }

 private:
  absl::Status Discard();
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
