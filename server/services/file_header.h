#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/dataset/dataset_files.h"
#include "server/data/blob_store.h"
#include "server/store/records.h"

// The stored files of a dataset as core takes them, and what the store keeps of their headers.
namespace pepeseg {

// Returns a file whose bytes are in `blob`. Its kind was checked at the upload.
DatasetFile StoredFile(const DatasetFileRecord& record, std::filesystem::path blob);

// Returns whether ReadFileHeader reads anything of files of this kind, see HasFacts.
bool HasHeader(const DatasetFileRecord& file);

// Fills in what ReadFileFacts returns, and that the header was read. A header that is refused is
// not an error: `file.header` says so, and RefusalOf returns why. INTERNAL or NOT_FOUND: the file
// cannot be read.
absl::Status ReadFileHeader(const std::filesystem::path& blob, DatasetFileRecord& file);

// Reads the header of a refused file again and returns INVALID_ARGUMENT with its name and the
// reason.
absl::Status RefusalOf(const std::filesystem::path& blob, const DatasetFileRecord& file);

// Returns the number of a dataset's mask files that may hold segments, by CountSegmentMasks. All
// of them count if the dataset's transforms.json has more than 8 MiB or is not stored.
int64_t CountSegmentMasks(const BlobStore& blobs, const std::string& project,
                          const std::vector<DatasetFileRecord>& files);

}  // namespace pepeseg
