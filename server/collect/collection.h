#pragma once

#include <filesystem>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/collect/collector.h"

namespace pepeseg {

// One run of the collector, and what it has removed so far.
struct Collection {
  Store& store;
  const CollectorOptions& options;
  absl::Time collector_made;
  Collected collected;

  // Remove a file, or a folder with all that is in it, and count what was removed. Failing to
  // remove something is not an error: the next run tries again.
  void Remove(const std::filesystem::path& file);
  void RemoveAll(const std::filesystem::path& folder);
};

// Returns the entries of a folder; none if it does not exist.
std::vector<std::filesystem::path> EntriesOf(const std::filesystem::path& folder);
// Returns the time since the last write, or zero if the file does not exist.
absl::Duration AgeOf(const std::filesystem::path& path);
// Returns the number of files in a folder, at any depth, and their total size.
Collected MeasureFolder(const std::filesystem::path& folder);

// Deletes open uploads without a write for options.upload_age: their records and partial files.
absl::Status CollectUploads(Collection& collection);
// Removes the partial files of uploads that are sealed or gone.
absl::Status CollectPartial(Collection& collection);
// Removes the blobs of each project that no dataset or upload of it names, and their records, by
// which they count in the project's usage.
absl::Status CollectBlobs(Collection& collection);
// Removes damaged blobs that were set aside (BlobStore::Verify) at least options.file_age ago.
void CollectDamaged(Collection& collection);
// Removes temporary files that a crash left, anywhere in the data directory.
void CollectTemporaries(Collection& collection);

}  // namespace pepeseg
