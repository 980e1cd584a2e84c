#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/model_files/model_file.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

// The field of a job as stage two trains it: a file that the worker replaces from time to time, so
// that the server can answer queries before there is a model (JobFolder::snapshot).
struct SnapshotFile {
  std::string job;    // its id
  int64_t fence = 0;  // of the attempt that has written it
  int64_t step = 0, num_steps = 0;
  FeatureField field;
};

// Writes the file, atomically: a checkpoint (core/model_files/checkpoint.h) of the stage "snapshot"
// with the identity "JOB/FENCE" and two sections: num_steps, an int64, and field, which has the
// format of features.bin (core/model_files/model_file.h). INVALID_ARGUMENT: the field is malformed.
absl::Status WriteSnapshotFile(const std::filesystem::path& path, const SnapshotFile& snapshot);

// Identifies one of the files that a job has written, one after the other.
struct SnapshotStamp {
  int64_t fence = 0;
  absl::Time modified;
  int64_t num_bytes = 0;

  bool operator==(const SnapshotStamp&) const = default;
};
// Returns the stamp of the file that an attempt has written last; nullopt: there is none yet.
std::optional<SnapshotStamp> FindSnapshotFile(const JobFolder& folder, int64_t fence);

// Reads the file, which is a worker's and is not trusted. DATA_LOSS: the bytes are damaged or
// malformed, or of another job or attempt. Other errors as BeneathFolder::ReadFile.
absl::StatusOr<SnapshotFile> ReadSnapshotFile(const JobFolder& folder, const std::string& job,
                                              int64_t fence, int64_t max_bytes);
// Copies the model without features that the Gaussians of an attempt's snapshots are in to the
// folder `to`. It is a worker's and is not trusted, but the copy cannot be changed by the worker.
// Errors as BeneathFolder::CopyFiles. NOT_FOUND: stage one has not ended, or the attempt has its
// model.
absl::Status CopySnapshotGaussians(const JobFolder& folder, int64_t fence,
                                   const std::filesystem::path& to, int64_t max_bytes);

}  // namespace pepeseg
