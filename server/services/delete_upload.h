#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/data/blob_store.h"
#include "server/store/store.h"

namespace pepeseg {

// Deletes an open upload: its record, then its partial files and the blobs that no other upload or
// dataset of the project names. A crash after the record is gone leaves files that the collector
// removes. NOT_FOUND. FAILED_PRECONDITION: it is sealed.
absl::Status DeleteUpload(Store& store, BlobStore& blobs, const UploadName& upload);

// Removes those of the blobs that no upload or dataset of the project names, and their records, by
// which they count in the project's usage. Waits for uploads that are just looking for blobs.
absl::Status RemoveUnnamedBlobs(Store& store, BlobStore& blobs, const std::string& project,
                                const std::vector<std::string>& digests);

}  // namespace pepeseg
