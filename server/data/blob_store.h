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

// The bytes of uploaded files, by project and digest. A blob is stored as a whole or not at all,
// even after a power cut, and never changes. While a blob is being uploaded, its first bytes are
// kept in a partial file of the upload, which can be resumed. Several servers may use the
// directory. Thread safe. Calls block on the disk.
class BlobStore {
 public:
  // Creates the folders.
  static absl::StatusOr<std::unique_ptr<BlobStore>> Open(const std::filesystem::path& data);

  // Returns whether the blob is stored, with this size.
  bool Has(const BlobName& blob, int64_t size) const;
  std::filesystem::path Path(const BlobName& blob) const { return BlobPath(data_, blob); }

  // Reads the whole blob and compares its SHA-256 with its name. DATA_LOSS: it is damaged and was
  // moved to damaged/, or it is not stored; from then on Has() is false, and the next upload that
  // names it stores it again. CANCELLED: `cancel` was set meanwhile.
  absl::Status Verify(const BlobName& blob, const std::atomic<bool>& cancel) const;

  // Returns a shared lock. While it is held no blob of the project is removed. An upload holds it
  // from before its files are recorded until its client knows which blobs are stored.
  absl::StatusOr<LockedFile> Hold(const std::string& project) const;

  // Waits for the exclusive lock: until nobody holds the shared one. While it is held, blobs that
  // no record names may be removed.
  absl::StatusOr<LockedFile> HoldAlone(const std::string& project) const;
  // Removes a blob. Returns whether it is gone. Call it under HoldAlone.
  bool Remove(const BlobName& blob) const;

  // Returns the committed bytes of the upload's partial files by digest, if more than 0.
  std::map<std::string, int64_t> ListPartial(const UploadName& upload) const;

  // Removes the partial files of an upload that is sealed or gone, except those that a stream is
  // writing. What cannot be removed is left to the collector.
  void RemovePartial(const UploadName& upload) const;

  // Returns a writer for a file of an upload, by its declared digest and size; call
  // BlobWriter::Start first. Returns null if the blob is stored already. ABORTED: another stream or
  // server is writing the file.
  absl::StatusOr<std::shared_ptr<BlobWriter>> Begin(const UploadName& upload,
                                                    const std::string& sha256, int64_t size);

  // Returns the free space of the file system, bytes.
  absl::StatusOr<int64_t> FreeBytes() const;

 private:
  explicit BlobStore(std::filesystem::path data) : data_(std::move(data)) {}
  absl::Status SetAside(const BlobName& blob, int descriptor) const;
  const std::filesystem::path data_;
};

}  // namespace pepeseg
