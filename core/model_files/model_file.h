#pragma once

#include <cstdint>
#include <filesystem>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/model.h"

namespace pepeseg {

// Writes a model to an existing folder: gaussians.ply (layout of 3DGS), features.bin (if the model
// has features), model.json and, last, manifest.json. Each file is written atomically.
// INVALID_ARGUMENT: the number of features differs from the number of Gaussians.
absl::Status WriteModel(const std::filesystem::path& folder, const Model& model);

// The numbers that determine the size of a model in memory.
struct ModelShape {
  int64_t num_gaussians = 0;
  int sh_degree = 0;
  int64_t max_view_pixels = 0;  // of the largest view; 0: no views
};
// Reads the shape from model.json and the header of gaussians.ply alone. DATA_LOSS: one of them is
// missing or malformed.
absl::StatusOr<ModelShape> ReadModelShape(const std::filesystem::path& folder);

// Reads a model and verifies its manifest; files that it does not list are ignored. NOT_FOUND:
// there is no manifest. DATA_LOSS: a file is missing, malformed or fails its checksum.
absl::StatusOr<Model> ReadModel(const std::filesystem::path& folder);

}  // namespace pepeseg
