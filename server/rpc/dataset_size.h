#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "core/reconstruct/estimate.h"
#include "server/rpc/service_context.h"

namespace pepeseg {

struct WantedTraining;

struct DatasetSize {
  TrainingSize training;
  int64_t max_source_pixels = 0;    // of a photograph as it was uploaded
  bool has_poses = false;           // else the stage "sfm" estimates them
  int64_t num_given_gaussians = 0;  // in place of stage one's; 0: none are given
};

// Videos count as the frames that are taken from them, of a size that is usual. From the headers of
// photographs (of many, of some dozens spread evenly) and of point files; decodes nothing.
// INVALID_ARGUMENT names a photograph whose header cannot be read.
absl::StatusOr<DatasetSize> MeasureDataset(const ServiceContext& context,
                                           const WantedTraining& training);

}  // namespace pepeseg
