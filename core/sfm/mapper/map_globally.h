#pragma once

#include <span>
#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/sfm/mapper/global_model.h"
#include "core/sfm/mapper/model_gates.h"

namespace pepeseg {

struct MapperOptions {
  int num_threads = 0;              // 0: one for each core. The result does not depend on it
  uint64_t seed = 1;                // of the positions' start
  double max_error = 3;             // pixels: of the pairs' inliers
  int tracks_per_photograph = 200;  // for the positions
  // Pairs of photographs that were compared, whether or not they matched; empty: all were.
  std::span<const PhotographIndices> compared = {};
};

// What MapGlobally found. The model is complete only if `gate` is kPassed; else the field says
// which gate it failed, and the model is what there was at that point.
struct MapperResult {
  MapperGate gate = MapperGate::kPassed;
  GlobalModel model;
  ModelMeasures measures;          // once there is a model
  double position_difference = 0;  // of two seeds, a share of the cameras' radius
};

// Maps all photographs at once: focal lengths, relative poses, rotation averaging, positions from
// two seeds by the strong pairs, and three rounds of triangulation and bundle adjustment, the last
// two by all matches that agree with the poses so far (METHOD.md, section on poses). Starts again
// where the adjustment changes a focal length much. Places photographs that have no pose yet by the
// points that they show, and frees principal points that the photographs determine. Then judges the
// model. Depends on the arguments only, not on the number of threads. `progress` gets the share of
// the work that is done; an error that it returns ends the mapping and is returned.
// INVALID_ARGUMENT: an index is out of range, or photographs of one camera group differ in size.
absl::StatusOr<MapperResult> MapGlobally(std::span<const MapperPhotograph> photographs,
                                         std::span<const VerifiedPair> pairs,
                                         const MapperOptions& options,
                                         absl::FunctionRef<absl::Status(double share)> progress);

}  // namespace pepeseg
