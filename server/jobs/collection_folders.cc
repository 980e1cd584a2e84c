#include "server/jobs/collection_folders.h"

#include <algorithm>
#include <system_error>

#include "absl/strings/match.h"

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
  std::vector<fs::path> old;
  std::error_code error;
  for (fs::recursive_directory_iterator entry(collection.options.data, error), end;
       !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    std::error_code ignored;
    if (absl::StrContains(name, ".tmp-") && entry->is_regular_file(ignored) &&
        AgeOf(entry->path()) >= collection.options.file_age) {
      old.push_back(entry->path());
    }
  }
  for (const fs::path& path : old) collection.Remove(path);
}

}  // namespace pepeseg
