#pragma once

#include <cstdint>
#include <filesystem>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/model.h"

namespace pepeseg {

// A model on disk: gaussians.ply (vanilla 3DGS layout), features.bin, model.json and,
// last, manifest.json with each file's size and sha256. Each file by temp + fsync + rename.
absl::Status WriteModel(const std::filesystem::path& folder, const Model& model);

// What the size of a model in memory follows from.
struct ModelShape {
  int64_t num_gaussians = 0;
  int sh_degree = 0;
  int64_t max_view_pixels = 0;
};
// From the heads of its files, before they are read: DATA_LOSS when they cannot be understood.
absl::StatusOr<ModelShape> ReadModelShape(const std::filesystem::path& folder);

// Trusts only what the manifest lists; DATA_LOSS when a file is missing or fails its checksum.
absl::StatusOr<Model> ReadModel(const std::filesystem::path& folder);

}  // namespace pepeseg
