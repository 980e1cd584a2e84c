#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/scene_model.h"
#include "google/protobuf/repeated_field.h"
#include "pepeseg/v1/decomposition.pb.h"

// Reads the parts of a request that name a decomposition, a level or a segment of it, and writes
// levels into answers. Readers return INVALID_ARGUMENT that names the field, at or below `field`.
namespace pepeseg {

// Returns the scales of a decomposition, or the default scales if there are none.
absl::StatusOr<std::vector<double>> ReadScales(
    const google::protobuf::RepeatedField<double>& scales, const std::string& field);
// Returns INVALID_ARGUMENT unless 0 <= level < num_levels.
absl::Status CheckLevelField(int32_t level, size_t num_levels, const std::string& field);

// Returns the Gaussians of a segment. Decomposes the model at the segment's scales if that has not
// been done, which takes long.
absl::StatusOr<GaussianSet> FindSegment(const SceneModel& model, const v1::SegmentRef& segment,
                                        const std::string& field);

// Returns the segment of each Gaussian at each of the scales, which ReadScales reads. Decomposes
// the model if that has not been done.
absl::StatusOr<std::vector<std::vector<int32_t>>> FindSegmentIds(
    const SceneModel& model, const google::protobuf::RepeatedField<double>& scales,
    const std::string& field);

v1::DecomposeModelResponse::Level LevelToProto(const Decomposition::Level& level,
                                               const Model& model);

}  // namespace pepeseg
