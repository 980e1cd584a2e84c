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

// The only writer of a partial file, which becomes a blob when it is complete.
//
// Committed bytes are on the disk, and a later writer can resume after them. The writer commits
// every 32 MiB and when it is destroyed. A complete file is checked (Finish), synced, and published
// under the blob's name, either alone (Commit) or together with other files
// (server/services/upload_files.h). Not thread safe. Calls block on the disk.
class BlobWriter {
 public:
  struct Target {
    std::filesystem::path partial;  // the partial file
    std::filesystem::path blob;     // the complete file, in a folder that exists
    std::string sha256;
    int64_t size = 0;  // declared, bytes
  };
  // Begins with the bytes that an earlier writer has committed. Call Start next.
  BlobWriter(LockedFile file, Target target);
  ~BlobWriter();
  BlobWriter(const BlobWriter&) = delete;
  BlobWriter& operator=(const BlobWriter&) = delete;

  int64_t committed() const { return committed_; }
  // Starts writing at `offset`: 0 to begin from scratch, or committed() to resume. OUT_OF_RANGE: it
  // is neither. When resuming, the committed bytes must be hashed again: call Rehash until ready().
  absl::Status Start(int64_t offset);
  bool ready() const { return hashed_ == written_; }
  // Hashes up to 64 MiB more of the committed bytes.
  absl::Status Rehash();

  // INVALID_ARGUMENT: more bytes than declared. RESOURCE_EXHAUSTED: the disk is full.
  absl::Status Append(std::string_view bytes);
  // Checks size and digest. Afterwards only Sync, Publish and Commit may be called.
  // INVALID_ARGUMENT: fewer bytes than declared. DATA_LOSS: another digest; then the partial file
  // is removed.
  absl::Status Finish();
  // Makes the written bytes durable. After an error those that were not committed are lost.
  absl::Status Sync();
  // Gives the finished and synced file the blob's name, which is durable once its folder is synced.
  absl::Status Publish();
  // Calls Finish, Sync and Publish, and syncs the folder.
  absl::Status Commit();

  int descriptor() const { return file_.descriptor(); }
  int64_t size() const { return target_.size; }
  const std::filesystem::path& blob() const { return target_.blob; }

 private:
  // Removes the partial file.
  absl::Status Discard();
  // Commits what is written: syncs it and records its length.
  absl::Status Record();

  LockedFile file_;
  const Target target_;
  Sha256 digest_;
  bool ended_ = false;                                // the partial file is published or removed
  int64_t committed_ = 0, written_ = 0, hashed_ = 0;  // bytes from the start of the file
};

// Returns the number of committed bytes of a partial file; 0 if there is none.
int64_t CommittedBytes(const std::filesystem::path& partial);

}  // namespace pepeseg
