#pragma once

#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/dataset/import.h"
#include "core/query/segmenter.h"
#include "core/scene/model.h"
#include "core/train/training_settings.h"
#include "pepeseg/v1/dataset_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "pepeseg/v1/training_options.pb.h"

// The only code that sees both the contract and core.
namespace pepeseg {

// Applies the preset, if one is given, then lays the fields that are present over `settings`;
// checks nothing.
void Overlay(const v1::TrainingOptions& proto, TrainingSettings* settings);
// The defaults, overlaid and validated: INVALID_ARGUMENT names the field and its range.
absl::StatusOr<TrainingSettings> TrainingSettingsFromProto(const v1::TrainingOptions& proto);
// Every field present.
v1::TrainingOptions ToProto(const TrainingSettings& settings);

// INVALID_ARGUMENT for UNSPECIFIED and for numbers that are none.
absl::StatusOr<FileKind> FileKindFromProto(v1::FileKind kind);

v1::View ToProto(const ModelView& view);
v1::ImageScores ToProto(const ImageScores& scores);
// INVALID_ARGUMENT names the field, below `field`, that is not finite or out of range.
absl::StatusOr<ModelView> FreeViewFromProto(const v1::Viewpoint::FreeCamera& proto,
                                            const std::string& field);

// One positive point at least, every one of them finite; that they are inside the view is the
// segmenter's to check.
absl::StatusOr<std::vector<PointPrompt>> PointsFromProto(const v1::PointsPrompt& proto);

// cosine * 32767 as little-endian int16.
v1::SegmentResponse::SimilarityMap SimilarityToProto(int width, int height,
                                                     std::span<const float> similarity);

}  // namespace pepeseg
