#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/data/blob_store.h"
#include "server/store/rows.h"

namespace pepeseg {

// Returns the number of a dataset's mask files that may hold segments, by CountSegmentMasks. All
// of them count if the dataset's transforms.json has more than 8 MiB or is not stored.
int64_t CountSegmentMasks(const BlobStore& blobs, const std::string& project,
                          const std::vector<DatasetFileRow>& files);

}  // namespace pepeseg
