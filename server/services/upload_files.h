#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "server/data/blob_store.h"
#include "server/data/blob_writer.h"
#include "server/store/store.h"

// The files of uploads on the disk: they are committed in groups, and removed with their upload.
namespace pepeseg {

// Complete files of one upload that are committed together: one sync of their bytes, renames to
// their final names, one sync of the folders, and one transaction. On a disk that takes 5 ms for a
// sync, 128 files take 15 ms in a group instead of 15 ms each.
//
// A file is stored once Commit has returned OK. A crash before that leaves each file of the group
// as a complete blob, as a partial file, or not at all. Not thread safe; Commit blocks.
class WriteGroup {
 public:
  struct File {
    DatasetFileRecord record;
    std::shared_ptr<BlobWriter> writer;  // finished; null: the blob is stored already
  };

  // Returns whether the group must be committed: it has 128 files or 32 MiB, or is a second old.
  bool due() const;
  bool empty() const { return files_.empty(); }
  // Returns the upload that all files of the group belong to.
  const UploadName& upload() const { return upload_; }
  // Returns whether a file of the group has these bytes.
  bool Holds(const std::string& sha256, int64_t size) const;

  void Add(const UploadName& upload, File file);
  // Commits the files and empties the group. An error names the file that failed; some files may
  // have been stored all the same: GetUpload knows which. NOT_FOUND: the upload was deleted, and
  // nothing is kept.
  absl::Status Commit(Store& store, BlobStore& blobs);

 private:
  static absl::Status Sync(const std::vector<File>& files);
  static absl::Status Publish(std::vector<File>& files);

  UploadName upload_;
  std::vector<File> files_;
  int64_t num_bytes_ = 0;
  absl::Time since_ = absl::InfiniteFuture();
};

// Deletes an open upload: its record, then its partial files and the blobs that no other upload or
// dataset of the project names. A crash after the record is gone leaves files that the collector
// removes. NOT_FOUND. FAILED_PRECONDITION: it is sealed.
absl::Status DeleteUpload(Store& store, BlobStore& blobs, const UploadName& upload);

// Removes those of the blobs that no upload or dataset of the project names, and their records, by
// which they count in the project's usage. Waits for uploads that are just looking for blobs.
absl::Status RemoveUnnamedBlobs(Store& store, BlobStore& blobs, const std::string& project,
                                const std::vector<std::string>& digests);

// Puts the client's name of a file before the message of an error, and into its detail.
absl::Status OfFile(const std::string& path, const absl::Status& status);

}  // namespace pepeseg
