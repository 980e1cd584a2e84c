#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace pepeseg {

// A model that the mapper has written (binary form).
struct SfmModel {
  std::filesystem::path folder;
  std::vector<std::string> names;  // of its registered photographs, sorted
  double reprojection_error = 0;   // mean over its points, pixels
};

// A folder with a model. DATA_LOSS names the file that is malformed.
absl::StatusOr<SfmModel> ReadSfmModel(const std::filesystem::path& folder);

// All models of the folders in `folder`, the largest first; among equals, that of the smaller
// reprojection error.
absl::StatusOr<std::vector<SfmModel>> ReadSfmModels(const std::filesystem::path& folder);

// Copies a model to `folder`, which must exist, with its photographs renamed by `names` (from
// COLMAP's to their owner's). The files: cameras.bin, images.bin, points3D.bin.
absl::Status CopyRenamed(const SfmModel& model, const std::map<std::string, std::string>& names,
                         const std::filesystem::path& folder);

}  // namespace pepeseg
