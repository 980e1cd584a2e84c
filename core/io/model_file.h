#pragma once

#include <filesystem>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/model.h"

namespace pepeseg {

// A model on disk (service.md): gaussians.ply (vanilla 3DGS layout), features.bin, model.json and,
// last, manifest.json with each file's size and sha256. Each file by temp + fsync + rename.
absl::Status WriteModel(const std::filesystem::path& folder, const Model& model);

// Trusts only what the manifest lists; DATA_LOSS when a file is missing or fails its checksum.
absl::StatusOr<Model> ReadModel(const std::filesystem::path& folder);

}  // namespace pepeseg
