#include "server/worker/worker_folders.h"

#include <system_error>

#include "core/base/file_error.h"

namespace pepeseg {

void RemoveIntermediates(const JobFolder& job, int64_t fence) {
  std::error_code ignored;
  for (int64_t earlier = 1; earlier < fence; ++earlier) {
    std::filesystem::remove_all(job.attempt(earlier), ignored);
  }
  std::filesystem::remove_all(job.priors(), ignored);
  std::filesystem::remove_all(job.reconstruction(fence), ignored);
  std::filesystem::remove_all(job.checkpoints(fence), ignored);
  std::filesystem::remove_all(job.frames(fence), ignored);
  std::filesystem::remove_all(HeicFolder(job, fence), ignored);
  std::filesystem::remove_all(job.poses(fence), ignored);
}

std::filesystem::path HeicFolder(const JobFolder& job, int64_t fence) {
  return job.attempt(fence) / "heic";
}

absl::StatusOr<int64_t> BytesIn(const std::filesystem::path& folder) {
  int64_t num_bytes = 0;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->is_regular_file(error)) num_bytes += static_cast<int64_t>(entry->file_size(error));
  }
  if (error) return FileError(folder, "list", error.value());
  return num_bytes;
}

}  // namespace pepeseg
