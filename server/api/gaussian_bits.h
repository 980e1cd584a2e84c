#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "core/query/scene_model.h"
#include "pepeseg/v1/selection_service.pb.h"

namespace pepeseg {

// Returns the set that `bits` has for a model of `num_gaussians`. INVALID_ARGUMENT, at `field`:
// they are not (num_gaussians + 7) / 8 bytes, or a bit beyond the last Gaussian is 1.
absl::StatusOr<GaussianSet> SetFromProto(const v1::GaussianBits& bits, int64_t num_gaussians,
                                         const std::string& field);
v1::GaussianBits ToProto(const GaussianSet& set);

}  // namespace pepeseg
