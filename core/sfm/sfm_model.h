#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace pepeseg {

// A COLMAP model in binary form, as the mapper writes it.
struct SfmModel {
  std::filesystem::path folder;
  std::vector<std::string> names;  // of the registered photographs, sorted
  double reprojection_error = 0;   // mean over the points, pixels
};

// Reads a folder with a model. DATA_LOSS, naming the file: it is malformed or cut short.
absl::StatusOr<SfmModel> ReadSfmModel(const std::filesystem::path& folder);

// Reads the models in the subfolders of `folder`, sorted by number of photographs, the largest
// first. Among equals, the one with the smaller reprojection error comes first.
absl::StatusOr<std::vector<SfmModel>> ReadSfmModels(const std::filesystem::path& folder);

// Copies cameras.bin, images.bin and points3D.bin of a model to `folder`, which must exist, and
// renames the photographs by `names`, which maps names in COLMAP to the owner's names. DATA_LOSS: a
// photograph of the model is not in `names`.
absl::Status CopyRenamed(const SfmModel& model, const std::map<std::string, std::string>& names,
                         const std::filesystem::path& folder);

}  // namespace pepeseg
