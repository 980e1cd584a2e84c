#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "core/scene/gaussians.h"
#include "pepeseg/v1/render.pb.h"
#include "server/rpc/service_context.h"
#include "server/services/model_lookup.h"

namespace pepeseg {

// The Gaussians of a loaded model that a request names, or none when it means all of them. Errors
// as FindSelection's and FindSegment's, below `field`; INVALID_ARGUMENT for the complement of
// nothing named. Blocks.
absl::StatusOr<std::optional<GaussianSet>> FindSubset(const ServiceContext& context,
                                                      const ResidentModel& model,
                                                      const v1::Subset& subset,
                                                      const std::string& field);

}  // namespace pepeseg
