#include "server/jobs/collection_folders.h"

#include <algorithm>
#include <system_error>

#include "absl/strings/match.h"
#include "server/layout.h"

namespace pepeseg {

namespace fs = std::filesystem;

void Collection::Remove(const fs::path& file) {
  std::error_code error;
  const auto size = fs::file_size(file, error);
  const int64_t bytes = error ? 0 : static_cast<int64_t>(size);
  if (!fs::remove(file, error) || error) return;
  ++collected.num_files;
  collected.num_bytes += bytes;
}

void Collection::RemoveAll(const fs::path& folder) {
  const Collected all = MeasureFolder(folder);
  std::error_code error;
  fs::remove_all(folder, error);
  if (error) return;
  collected.num_files += all.num_files;
  collected.num_bytes += all.num_bytes;
}

std::vector<fs::path> EntriesOf(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    entries.push_back(entry->path());
  }
  return entries;
}

absl::Duration AgeOf(const fs::path& path) {
  std::error_code error;
  const fs::file_time_type written = fs::last_write_time(path, error);
  if (error) return absl::ZeroDuration();
  return absl::FromChrono(fs::file_time_type::clock::now() - written);
}

Collected MeasureFolder(const fs::path& folder) {
  Collected sum;
  std::error_code error;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    if (!entry->is_regular_file(ignored)) continue;
    ++sum.num_files;
    const auto size = entry->file_size(ignored);
    if (!ignored) sum.num_bytes += static_cast<int64_t>(size);
  }
  return sum;
}

void CollectTemporaries(Collection& collection) {
  const CollectorOptions& options = collection.options;
  // Files get the time of a clock that goes a little behind.
  constexpr absl::Duration kCoarse = absl::Milliseconds(20);
  const absl::Duration since_start = absl::Now() - collection.collector_made + kCoarse;
  const absl::Duration age =
      options.alone ? std::min(since_start, options.file_age) : options.file_age;
  const std::string jobs = (JobsFolder(options.data) / "").string();
  std::vector<fs::path> dead;
  std::error_code error;
  for (fs::recursive_directory_iterator entry(options.data, error), end; !error && entry != end;
       entry.increment(error)) {
    const fs::path& path = entry->path();
    std::error_code ignored;
    if (!absl::StrContains(path.filename().string(), ".tmp-")) continue;
    const bool of_job = absl::StartsWith(path.string(), jobs);
    if (AgeOf(path) < (of_job ? options.file_age : age)) continue;
    if (entry->is_regular_file(ignored)) dead.push_back(path);
  }
  for (const fs::path& path : dead) collection.Remove(path);
}

}  // namespace pepeseg
