#pragma once

#include <filesystem>
#include <vector>

#include "absl/time/time.h"
#include "server/collect/collector.h"

namespace pepeseg {

// One run of the collector, and what it removes.
struct Collection {
  Store& store;
  const CollectorOptions& options;
  absl::Time collector_made;
  Collected collected;

  // Both count what has gone; that something stays is no error.
  void Remove(const std::filesystem::path& file);
  void RemoveAll(const std::filesystem::path& folder);
};

// What is in a folder; nothing where there is none.
std::vector<std::filesystem::path> EntriesOf(const std::filesystem::path& folder);
// Since its last write; zero for what is not there.
absl::Duration AgeOf(const std::filesystem::path& path);
// Its files and their bytes.
Collected MeasureFolder(const std::filesystem::path& folder);

// Of files that a crash left half written, anywhere in the data directory.
void CollectTemporaries(Collection& collection);

}  // namespace pepeseg
