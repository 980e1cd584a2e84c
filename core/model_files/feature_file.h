#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/model.h"

namespace pepeseg {

inline constexpr int kFeatureDim = 32;

// Writes a feature field as a file, atomically. Its format, little-endian without padding:
//   char[8]   "PPSGFEAT"
//   uint32    version: 1, or 2 if the gate has two layers
//   uint32    feature dimension, 32
//   uint64    num_gaussians
//   uint32    num_quantiles
//   uint32    1: the file has confidences; 0: it does not
//   float32   gate[64]: W[32], b[32]; in version 2 gate[1120]: W1[32], b1[32], W2[32, 32], b2[32]
//             (kernels/math/gate.h)
//   float32   scale_quantiles[num_quantiles], ascending, scene units
//   float16   features[num_gaussians, 32], smoothed and normalised
//   float16   confidence[num_gaussians], in (0, 1], if the file has them
// INVALID_ARGUMENT: sizes do not match, the gate has another size, a value is not finite, quantiles
// descend, or a confidence is out of range.
absl::Status WriteFeatureFile(const std::filesystem::path& path, const FeatureField& field);
// Reads such a file. INVALID_ARGUMENT, naming `name`: as above, or the file is of another format or
// version or is cut short.
absl::StatusOr<FeatureField> ReadFeatureFile(const std::filesystem::path& path,
                                             const std::string& name);

}  // namespace pepeseg
