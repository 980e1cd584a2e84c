#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/benchmark/scene_truth.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

// The requests that score the models of `pepeseg-benchmark curves` and of our own scenes.
namespace pepeseg::client::cli {

// Returns a request that scores `model` on the held-out views that have a label image or outlines,
// with the dataset's ignore mask. Outlines are drawn in the size of the photograph. Images of
// another size than the photograph are resampled to it (nearest neighbour). INVALID_ARGUMENT: the
// shape of an image, also of one that was drawn on, differs from that of its photograph, or an
// image to be resampled has an id over 255.
absl::StatusOr<v1::EvaluateModelRequest> EvaluateRequestOf(const std::filesystem::path& dataset,
                                                           const TruthLevel& level,
                                                           const std::string& model,
                                                           const std::vector<v1::View>& views);

}  // namespace pepeseg::client::cli
