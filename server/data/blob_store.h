#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/data/blob_writer.h"
#include "server/data/locked_file.h"
#include "server/store/layout.h"

namespace pepeseg {

// The bytes of uploaded files, by project and digest: a blob is there as a whole or not at all,
// also after a power cut, and never changes. Of one on its way the beginning is kept, for the
// upload that brings it. Several servers may be on the directory. Thread safe. Calls block.
class BlobStore {
 public:
  // Makes the folders. Blobs of before there were projects become the default project's; when that
  // is cut off, the next start goes on with it.
  static absl::StatusOr<std::unique_ptr<BlobStore>> Open(const std::filesystem::path& data);

  bool Has(const BlobName& blob, int64_t size) const;
  std::filesystem::path Path(const BlobName& blob) const { return BlobPath(data_, blob); }

  // Reads the blob again, at the disk's speed, and compares its SHA-256 with its name. DATA_LOSS:
  // it is damaged, and was moved to damaged/, or is not there; Has() is false from then on, and the
  // next upload that names it brings it again. CANCELLED: `cancel` was set meanwhile.
  absl::Status Verify(const BlobName& blob, const std::atomic<bool>& cancel) const;

  // While it lives, no blob of the project is removed: from before an upload names a digest until
  // its client was told that the blob is there.
  absl::StatusOr<LockedFile> Hold(const std::string& project) const;

  // Committed bytes of the upload's files that are on their way, by digest; more than 0.
  std::map<std::string, int64_t> ListPartial(const UploadName& upload) const;

  // Removes the partial files of an upload that is sealed or gone, but for those that a stream has
  // open. What cannot be removed is left to the collector.
  void RemovePartial(const UploadName& upload) const;

  // Of a file of an upload, which declared its digest and size; to be started at an offset first.
  // Null: the blob is there. ABORTED: another stream, or another server, writes it.
  absl::StatusOr<std::shared_ptr<BlobWriter>> Begin(const UploadName& upload,
                                                    const std::string& sha256, int64_t size);

  // That can be written now, bytes.
  absl::StatusOr<int64_t> FreeBytes() const;

 private:
  explicit BlobStore(std::filesystem::path data) : data_(std::move(data)) {}
  absl::Status SetAside(const BlobName& blob, int descriptor) const;
  const std::filesystem::path data_;
};

}  // namespace pepeseg
