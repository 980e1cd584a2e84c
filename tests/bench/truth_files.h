#pragma once

#include <filesystem>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"
#include "tests/bench/capture_pack.h"

namespace pepeseg {

// Reads the ground truth of a dataset folder: the levels named in gt/labels.json with label images
// gt/LEVEL/STEM.png, or one level labels/STEM.png. Returns no level if there is neither. Labels are
// resampled for photographs that were shrunk. Returns INVALID_ARGUMENT, which names the file, for
// photographs that were undistorted.
absl::StatusOr<std::vector<TruthLevel>> ReadTruth(const std::filesystem::path& folder,
                                                  const Capture& capture);

}  // namespace pepeseg
