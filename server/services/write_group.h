#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "server/data/blob_writer.h"
#include "server/store/store.h"

namespace pepeseg {

// Files of one upload that have come as a whole and are committed together: one sync of their
// bytes, their new names, one sync of the folders, and one transaction. On a disk that takes 5 ms
// for a sync, that is 15 ms for 128 files instead of for each.
//
// A file counts once Commit has returned OK for it. Nothing of a group counts before, but a crash
// in between leaves each file as a whole blob, as a partial file, or not at all. For one thread at
// a time; Commit blocks.
class WriteGroup {
 public:
  struct File {
    DatasetFileRow row;
    std::shared_ptr<BlobWriter> writer;  // finished; null: the blob is there
  };

  // To be committed before it takes more: 128 files, 32 MiB, or a second old.
  bool due() const;
  bool empty() const { return files_.empty(); }
  // Files to be added must be of this upload.
  const UploadName& upload() const { return upload_; }
  // Whether one of its files has these bytes.
  bool Holds(const std::string& sha256, int64_t size) const;

  void Add(const UploadName& upload, File file);
  // Commits what was added, and starts anew. The error names the file at which it met it; which
  // files count then is what GetUpload says.
  absl::Status Commit(Store& store);

 private:
  static absl::Status Sync(const std::vector<File>& files);
  static absl::Status Publish(std::vector<File>& files);

  UploadName upload_;
  std::vector<File> files_;
  int64_t num_bytes_ = 0;
  absl::Time since_ = absl::InfiniteFuture();
};

// The client's name of the file in front of what went wrong with it, and as the error's resource.
absl::Status OfFile(const std::string& path, const absl::Status& status);

}  // namespace pepeseg
