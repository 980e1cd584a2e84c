#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/model_files/manifest.h"
#include "core/scene/gaussians.h"
#include "core/scene/model.h"

namespace pepeseg {

// Writes a model to an existing folder: gaussians.ply (layout of 3DGS), features.bin (if the model
// has features), model.json and, last, manifest.json. Each file is written atomically.
// INVALID_ARGUMENT: the number of features differs from the number of Gaussians.
absl::Status WriteModel(const std::filesystem::path& folder, const Model& model);

// Metrics of an early model (core/train/early_field.h): steps of stage one done, and their number.
inline constexpr char kEarlyStep[] = "early_step";
inline constexpr char kEarlyNumSteps[] = "early_num_steps";

// Reads the shape from model.json and the header of gaussians.ply alone. DATA_LOSS: one of them is
// missing or malformed.
absl::StatusOr<ModelShape> ReadModelShape(const std::filesystem::path& folder);

// Reads a model and verifies its manifest; files that it does not list are ignored. NOT_FOUND:
// there is no manifest. DATA_LOSS: a file is missing, malformed or fails its checksum.
absl::StatusOr<Model> ReadModel(const std::filesystem::path& folder);

// Reads the views of a model, from model.json alone, and verifies its digest. Errors as ReadModel.
absl::StatusOr<std::vector<ModelView>> ReadModelViews(const std::filesystem::path& folder);
// Formats a view as model.json has it, and parses such a text. DATA_LOSS: it is malformed.
std::string FormatView(const ModelView& view);
absl::StatusOr<ModelView> ParseView(absl::string_view text);

inline constexpr int kFeatureDim = 32;  // numbers of a feature

// Writes a feature field, the file features.bin of a model, atomically. Its format, little-endian
// without padding:
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
// Return the bytes of such a file, and the field in them, with the same errors, which name `name`.
absl::StatusOr<std::string> FormatFeatureField(const FeatureField& field, const std::string& name);
absl::StatusOr<FeatureField> ParseFeatureField(std::string_view bytes, const std::string& name);

// Writes a selection as a file, atomically. Its format, little-endian without padding:
//   char[8]   "PPSGSELE"
//   uint32    version, 1
//   uint32    0
//   uint64    num_gaussians of the model, at most 50,000,000
//   uint8     bits[(num_gaussians + 7) / 8]: bit i % 8 of byte i / 8 is 1 if Gaussian i is a
//   member;
//             unused bits of the last byte are 0
//   char[64]  SHA-256 of all bytes before, lower-case hexadecimal
absl::Status WriteSelectionFile(const std::filesystem::path& path, const GaussianSet& set);

// Reads such a file. DATA_LOSS, naming `name`: there is no such file, it is malformed or of another
// version, or its checksum is wrong.
absl::StatusOr<GaussianSet> ReadSelectionFile(const std::filesystem::path& path,
                                              const std::string& name);

}  // namespace pepeseg
