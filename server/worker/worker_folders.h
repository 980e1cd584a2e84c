#pragma once

#include <cstdint>
#include <filesystem>

#include "absl/status/statusor.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

// What the stages before the last one left: frames, poses, what made priors, stage one's results
// and the checkpoints of this attempt and of earlier ones, once there is a model.
void RemoveIntermediates(const JobFolder& job, int64_t fence);

// JPEGs of an attempt's HEIC photographs.
std::filesystem::path HeicFolder(const JobFolder& job, int64_t fence);

// Of the files in a folder, without those in folders below it.
absl::StatusOr<int64_t> BytesIn(const std::filesystem::path& folder);

}  // namespace pepeseg
