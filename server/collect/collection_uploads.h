#pragma once

#include "absl/status/status.h"
#include "server/collect/collection_folders.h"

// The parts of a collector's run that are about uploaded files.
namespace pepeseg {

// Rows of open uploads without a write for as long as options.upload_age.
absl::Status CollectUploads(Collection& collection);
// Beginnings of files of uploads that are sealed or gone.
absl::Status CollectBeginnings(Collection& collection);
// Of each project those that no dataset and no upload of it names, and their records, by which they
// count in its usage.
absl::Status CollectBlobs(Collection& collection);
// Damaged blobs that were set aside (BlobStore::Verify) at least options.file_age ago.
void CollectDamaged(Collection& collection);

}  // namespace pepeseg
