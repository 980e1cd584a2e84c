#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/model.h"

namespace pepeseg {

inline constexpr int kFeatureDim = 32;

// A feature field on disk, little-endian, without padding:
//   char[8]   "PPSGFEAT"
//   uint32    version, 1
//   uint32    feature dimension, 32
//   uint64    num_gaussians
//   uint32    num_quantiles
//   uint32    1: with confidences; 0: without
//   float32   gate[64]: W[32], b[32]
//   float32   scale_quantiles[num_quantiles], ascending, scene units
//   float16   features[num_gaussians, 32], smoothed and normalised
//   float16   confidence[num_gaussians], (0, 1], where there are any
// Written atomically. INVALID_ARGUMENT: sizes that do not fit each other, a value that is not
// finite, quantiles that descend, a confidence out of range.
absl::Status WriteFeatureFile(const std::filesystem::path& path, const FeatureField& field);
absl::StatusOr<FeatureField> ReadFeatureFile(const std::filesystem::path& path,
                                             const std::string& name);

}  // namespace pepeseg
