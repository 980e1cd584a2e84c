#include "server/worker/worker_verify.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/digest.h"
#include "core/base/status_macros.h"
#include "kernels/cpu/parallel_for.h"

namespace pepeseg {
namespace {

// A blob of the spec, and what was found of it.
struct InputBlob {
  std::string path;
  std::string sha256;  // declared
  absl::StatusOr<std::string> found;
};

std::vector<InputBlob> DistinctBlobs(const JobSpec& spec) {
  std::vector<InputBlob> blobs;
  std::set<std::pair<std::string, std::string>> known;
  for (const JobSpecFile& file : spec.files) {
    if (known.emplace(file.path, file.sha256).second) blobs.push_back({file.path, file.sha256, ""});
  }
  return blobs;
}

int64_t BytesOf(const std::vector<InputBlob>& blobs) {
  int64_t bytes = 0;
  for (const InputBlob& blob : blobs) {
    std::error_code error;
    const auto size = std::filesystem::file_size(blob.path, error);
    if (!error) bytes += static_cast<int64_t>(size);
  }
  return bytes;
}

void HashAll(int num_threads, std::vector<InputBlob>& blobs) {
  const absl::Time start = absl::Now();
  ThreadPool pool(num_threads);
  pool.ParallelFor(static_cast<int64_t>(blobs.size()), [&](int64_t i, int) {
    InputBlob& blob = blobs[static_cast<size_t>(i)];
    blob.found = Sha256OfFile(blob.path);
  });
  const double seconds = absl::ToDoubleSeconds(absl::Now() - start);
  const double megabytes = static_cast<double>(BytesOf(blobs)) / 1e6;
  spdlog::info("verified {} stored files: {:.1f} MB in {:.3f} s, {:.0f} MB/s", blobs.size(),
               megabytes, seconds, megabytes / std::max(seconds, 1e-6));
}

}  // namespace

absl::Status VerifyInputs(const JobSpec& spec, std::vector<std::string>& damaged) {
  std::vector<InputBlob> blobs = DistinctBlobs(spec);
  HashAll(spec.num_threads, blobs);
  std::map<std::pair<std::string, std::string>, const InputBlob*> by_name;
  for (const InputBlob& blob : blobs) by_name[{blob.path, blob.sha256}] = &blob;
  std::string first;
  int num_files = 0;
  std::set<std::string> digests;
  for (const JobSpecFile& file : spec.files) {
    const absl::StatusOr<std::string>& found = by_name.at({file.path, file.sha256})->found;
    if (!found.ok() && !absl::IsNotFound(found.status())) {
      return absl::InternalError(absl::StrCat(file.name, ": cannot be read"));
    }
    if (found.ok() && *found == file.sha256) continue;
    if (++num_files == 1) {
      first = absl::StrCat(file.name, ": its stored bytes are ", found.ok() ? "damaged" : "gone");
    }
    if (digests.insert(file.sha256).second) damaged.push_back(file.sha256);
  }
  if (num_files == 0) return absl::OkStatus();
  if (num_files > 1) absl::StrAppend(&first, ", as are those of ", num_files - 1, " more files");
  return absl::DataLossError(
      absl::StrCat(first, "; upload the same files again, then train again"));
}

}  // namespace pepeseg
