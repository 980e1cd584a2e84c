#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/segmenter.h"
#include "core/scene/gaussians.h"
#include "google/protobuf/repeated_field.h"
#include "pepeseg/v1/decomposition.pb.h"

// Parts of a request that name a decomposition or some of it. INVALID_ARGUMENT names the field, at
// or below `field`.
namespace pepeseg {

// The scales of a decomposition, the default ones for none.
absl::StatusOr<std::vector<double>> ReadScales(
    const google::protobuf::RepeatedField<double>& scales, const std::string& field);
// That there is such a level of so many.
absl::Status CheckLevelField(int32_t level, size_t num_levels, const std::string& field);

// The Gaussians of a segment. Takes the model apart when it has not been at these scales.
absl::StatusOr<GaussianSet> FindSegment(const Segmenter& segmenter, const v1::SegmentRef& segment,
                                        const std::string& field);

}  // namespace pepeseg
