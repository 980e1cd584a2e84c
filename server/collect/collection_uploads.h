#pragma once

#include "absl/status/status.h"
#include "server/collect/collection_folders.h"

// The parts of a collector's run that deal with uploaded files.
namespace pepeseg {

// Deletes open uploads without a write for options.upload_age: their records and partial files.
absl::Status CollectUploads(Collection& collection);
// Removes the partial files of uploads that are sealed or gone.
absl::Status CollectPartial(Collection& collection);
// Removes the blobs of each project that no dataset or upload of it names, and their records, by
// which they count in the project's usage.
absl::Status CollectBlobs(Collection& collection);
// Removes damaged blobs that were set aside (BlobStore::Verify) at least options.file_age ago.
void CollectDamaged(Collection& collection);

}  // namespace pepeseg
