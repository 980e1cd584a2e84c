#pragma once

#include <filesystem>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"
#include "tests/bench/capture_pack.h"

namespace pepeseg {

// The ground truth of a dataset folder: the levels that gt/labels.json names, with label images in
// gt/LEVEL/STEM.png, or one level of labels/STEM.png; none where there is neither. Labels follow
// photographs that were shrunk, but not those whose lens was undone: INVALID_ARGUMENT names the
// file.
absl::StatusOr<std::vector<TruthLevel>> ReadTruth(const std::filesystem::path& folder,
                                                  const Capture& capture);

}  // namespace pepeseg
