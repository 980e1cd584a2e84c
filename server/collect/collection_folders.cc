#include "server/collect/collection_folders.h"

#include <algorithm>
#include <system_error>

#include "absl/strings/match.h"
#include "core/base/beneath_folder.h"
#include "server/store/layout.h"

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
  // Follows no symbolic links: workers can write to these folders.
  if (!RemoveBeneath(folder.parent_path(), folder.filename()).ok()) return;
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
  // A file whose age is unknown counts as new, and stays.
  if (error) return absl::ZeroDuration();
  return absl::FromChrono(fs::file_time_type::clock::now() - written);
}

Collected MeasureFolder(const fs::path& folder) {
  Collected sum;
  const absl::StatusOr<BeneathFolder> top = BeneathFolder::Open(folder);
  if (!top.ok()) return sum;
  VisitFiles(*top, [&](const BeneathFolder& where, const std::string& name) {
    const auto facts = where.Look(name);
    if (!facts) return;
    ++sum.num_files;
    sum.num_bytes += facts->num_bytes;
  });
  return sum;
}

void CollectTemporaries(Collection& collection) {
  const CollectorOptions& options = collection.options;
  // The kernel stamps files with a clock that lags behind by up to one tick.
  constexpr absl::Duration kCoarse = absl::Milliseconds(20);
  const absl::Time now = absl::Now();
  const absl::Duration since_start = now - collection.collector_made + kCoarse;
  // A server that is alone on the directory knows that temporary files from before its start have
  // no writer. Those under jobs/ may be of workers that outlived a server.
  const absl::Duration alone =
      options.alone ? std::min(since_start, options.file_age) : options.file_age;
  const absl::StatusOr<BeneathFolder> data = BeneathFolder::Open(options.data);
  const auto entries = data.ok() ? data->List() : data.status();
  if (!entries.ok()) return;
  const std::string jobs = JobsFolder("").string();
  for (const BeneathFolder::Entry& entry : *entries) {
    const absl::Duration age = entry.name == jobs ? options.file_age : alone;
    const auto visit = [&](const BeneathFolder& where, const std::string& name) {
      // The form of names that WriteFileAtomically gives to files before it renames them.
      if (!absl::StrContains(name, ".tmp-")) return;
      const auto facts = where.Look(name);
      if (!facts || now - facts->modified < age || !where.RemoveAll(name).ok()) return;
      ++collection.collected.num_files;
      collection.collected.num_bytes += facts->num_bytes;
    };
    if (entry.is_file) visit(*data, entry.name);
    const auto below = data->OpenFolder(entry.name);
    if (entry.is_folder && below.ok()) VisitFiles(*below, visit);
  }
}

}  // namespace pepeseg
