#include "server/services/delete_upload.h"

#include <set>

#include "core/base/status_macros.h"

namespace pepeseg {

absl::Status DeleteUpload(Store& store, BlobStore& blobs, const UploadName& upload) {
  ASSIGN_OR_RETURN(const auto files, store.files().ListDatasetFiles(upload.scene, upload.number));
  // The record first: a stream that starts now finds no upload, and one that writes finds it gone
  // when it commits.
  RETURN_IF_ERROR(store.datasets().DeleteUpload(upload.scene, upload.number));
  blobs.RemovePartial(upload);
  std::vector<std::string> digests;
  digests.reserve(files.size());
  for (const DatasetFileRow& file : files) digests.push_back(file.sha256);
  return RemoveUnnamedBlobs(store, blobs, upload.project, digests);
}

absl::Status RemoveUnnamedBlobs(Store& store, BlobStore& blobs, const std::string& project,
                                const std::vector<std::string>& digests) {
  // Uploads hold the shared lock from before they look for blobs until their records name them, so
  // what is unnamed under the exclusive lock stays so until it is removed.
  ASSIGN_OR_RETURN(const LockedFile alone, blobs.HoldAlone(project));
  ASSIGN_OR_RETURN(const std::set<std::string> named, store.files().ListDigests(project));
  std::vector<std::string> gone;
  for (const std::string& digest : digests) {
    // Only blobs that are gone leave the quota. The collector tries the others again.
    if (!named.contains(digest) && blobs.Remove({project, digest})) gone.push_back(digest);
  }
  return store.files().ForgetBlobs(project, gone);
}

}  // namespace pepeseg
