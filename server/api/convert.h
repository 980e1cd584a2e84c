#pragma once

#include <array>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/query/scene_model.h"
#include "core/train/settings/training_settings.h"
#include "google/protobuf/duration.pb.h"
#include "google/protobuf/timestamp.pb.h"
#include "pepeseg/v1/dataset_service.pb.h"
#include "pepeseg/v1/geometry.pb.h"
#include "pepeseg/v1/scene_service.pb.h"
#include "pepeseg/v1/training_options.pb.h"

// Conversions between messages of the contract and types of core that server and worker both need.
namespace pepeseg {

// Returns the defaults, with the preset of `proto`, its fields and then its `advanced` options
// applied. INVALID_ARGUMENT names the option and its range.
absl::StatusOr<TrainingSettings> TrainingSettingsFromProto(const v1::TrainingOptions& proto);
// Returns a message with every option: in its field, or in `advanced` if it has none.
v1::TrainingOptions ToProto(const TrainingSettings& settings);

// Returns INVALID_ARGUMENT for UNSPECIFIED and for numbers that are not values of the enum.
absl::StatusOr<FileKind> FileKindFromProto(v1::FileKind kind);

google::protobuf::Timestamp ToProto(absl::Time time);
google::protobuf::Duration ToProto(absl::Duration duration);
v1::Vector3 VectorToProto(const std::array<double, 3>& vector);
v1::View ToProto(const ModelView& view);
v1::ImageScores ToProto(const ImageScores& scores);

}  // namespace pepeseg
