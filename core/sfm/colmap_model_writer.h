#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/sfm/front/colmap_database.h"
#include "core/sfm/mapper/global_model.h"
#include "core/sfm/sfm_photographs.h"

namespace pepeseg {

using PointColour = std::array<uint8_t, 3>;  // red, green, blue

// Returns the mean colour of each point's pixels in the photographs, by the order of
// `model.points`. `photographs` are those of `features`, in the same order; each is decoded once.
// The same for any number of threads. Errors of DecodePhoto.
absl::StatusOr<std::vector<PointColour>> ColourPoints(std::span<const SfmPhotograph> photographs,
                                                      const DatabaseFeatures& features,
                                                      const GlobalModel& model, int num_threads);

// Writes cameras.bin, images.bin and points3D.bin as COLMAP 3.8 does: SIMPLE_RADIAL cameras, the
// registered photographs with all their features, the points with their errors (mean over the
// observations, pixels) and tracks. `model.lenses` are by `features.cameras`. Creates the folder.
// INTERNAL: a file cannot be written.
absl::Status WriteColmapModel(const DatabaseFeatures& features, const GlobalModel& model,
                              std::span<const PointColour> colours,
                              const std::filesystem::path& folder);

}  // namespace pepeseg
