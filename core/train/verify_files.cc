#include "core/train/verify_files.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "core/base/digest.h"
#include "core/base/status_macros.h"
#include "kernels/cpu/parallel_for.h"

namespace pepeseg {
namespace {

// A file to read, and its digest once it was read.
struct StoredFile {
  std::filesystem::path path;
  absl::StatusOr<std::string> found;
};

// Files with the same bytes are stored once, under one path.
std::vector<StoredFile> DistinctFiles(const TrainingInputs& inputs) {
  std::vector<StoredFile> stored;
  std::set<std::filesystem::path> known;
  for (const DatasetFile& file : inputs.files) {
    if (known.insert(file.path).second) stored.push_back({file.path, ""});
  }
  return stored;
}

// Sum of the sizes, for the log; files that are gone count 0.
int64_t BytesOf(const std::vector<StoredFile>& stored) {
  int64_t bytes = 0;
  for (const StoredFile& file : stored) {
    std::error_code error;
    const auto size = std::filesystem::file_size(file.path, error);
    if (!error) bytes += static_cast<int64_t>(size);
  }
  return bytes;
}

void HashAll(int num_threads, std::vector<StoredFile>& stored, TrainingObserver& observer) {
  const absl::Time start = absl::Now();
  ThreadPool pool(num_threads);
  pool.ParallelFor(static_cast<int64_t>(stored.size()), [&](int64_t i, int) {
    StoredFile& file = stored[static_cast<size_t>(i)];
    file.found = Sha256OfFile(file.path);
  });
  const double seconds = absl::ToDoubleSeconds(absl::Now() - start);
  const double megabytes = static_cast<double>(BytesOf(stored)) / 1e6;
  observer.Log(absl::StrFormat("verified %d stored files: %.1f MB in %.3f s, %.0f MB/s",
                               stored.size(), megabytes, seconds,
                               megabytes / std::max(seconds, 1e-6)));
}

}  // namespace

absl::Status VerifyFiles(const TrainingInputs& inputs, TrainingObserver& observer) {
  if (inputs.sha256.empty()) return absl::OkStatus();
  std::vector<StoredFile> stored = DistinctFiles(inputs);
  HashAll(inputs.tools.num_threads, stored, observer);
  std::map<std::filesystem::path, const StoredFile*> by_path;
  for (const StoredFile& file : stored) by_path[file.path] = &file;
  std::string first;
  int num_files = 0;
  std::set<std::string> digests;
  for (size_t i = 0; i < inputs.files.size(); ++i) {
    const std::string& name = inputs.files[i].name;
    const absl::StatusOr<std::string>& found = by_path.at(inputs.files[i].path)->found;
    if (!found.ok() && !absl::IsNotFound(found.status())) {
      return absl::InternalError(absl::StrCat(name, ": cannot be read"));
    }
    if (found.ok() && *found == inputs.sha256[i]) continue;
    if (++num_files == 1) {
      first = absl::StrCat(name, ": its stored bytes are ", found.ok() ? "damaged" : "gone");
    }
    if (digests.insert(inputs.sha256[i]).second) observer.ReportDamagedFile(inputs.sha256[i]);
  }
  if (num_files == 0) return absl::OkStatus();
  if (num_files > 1) absl::StrAppend(&first, ", as are those of ", num_files - 1, " more files");
  return absl::DataLossError(
      absl::StrCat(first, "; upload the same files again, then train again"));
}

}  // namespace pepeseg
