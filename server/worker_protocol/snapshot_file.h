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

// Identifies one of the snapshots that a job has written, one after the other.
struct SnapshotStamp {
  int64_t fence = 0;
  absl::Time modified = {};
  int64_t num_bytes = 0;
  bool is_early = false;  // it is the model in JobFolder::early, and has no file

  bool operator==(const SnapshotStamp&) const = default;
};
// Returns the stamp of the file that an attempt has written last, or that of its early model if it
// has written no file yet; nullopt: there is neither.
std::optional<SnapshotStamp> FindSnapshot(const JobFolder& folder, int64_t fence);

// Reads the file, which is a worker's and is not trusted. DATA_LOSS: the bytes are damaged or
// malformed, or of another job or attempt. Other errors as BeneathFolder::ReadFile.
absl::StatusOr<SnapshotFile> ReadSnapshotFile(const JobFolder& folder, const std::string& job,
                                              int64_t fence, int64_t max_bytes);
// Copies the model that the Gaussians of a snapshot are in to the folder `to`: without features,
// but for an early model. It is a worker's and is not trusted, but the copy cannot be changed by
// the worker. Errors as BeneathFolder::CopyFiles. NOT_FOUND: stage one has not ended, or the
// attempt has its model.
absl::Status CopySnapshotGaussians(const JobFolder& folder, const SnapshotStamp& stamp,
                                   const std::filesystem::path& to, int64_t max_bytes);

}  // namespace pepeseg
