#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/benchmark/suite_scene.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

// Requests that score the models of benchmarks.
namespace pepeseg::client::cli {

// Returns the protocol that a benchmark is scored by.
v1::EvaluationProtocol ProtocolOf(Benchmark benchmark);

// Returns the request that scores `model` on the scene's truth by `protocol`. Masks are resampled
// to the size of their photograph (nearest neighbour). SPIn-NeRF scores trained views and the
// reference view, too, and NVOS has its reference view among those that were trained on.
// INVALID_ARGUMENT: a view is not one of the model, a mask has another shape than its photograph,
// or positive strokes are empty.
absl::StatusOr<v1::EvaluateModelRequest> ScoreRequest(Benchmark benchmark,
                                                      const BenchmarkScene& scene,
                                                      v1::EvaluationProtocol protocol,
                                                      const std::vector<v1::View>& views);

// Returns the requests for the agreement with SAM, one a held-out view that has masks in SAM's
// format (masks/STEM.json with "predicted_iou"). Empty: no view has. INVALID_ARGUMENT: a file is
// malformed.
absl::StatusOr<std::vector<v1::EvaluateModelRequest>> SamRequests(
    const BenchmarkScene& scene, const std::vector<v1::View>& views);

}  // namespace pepeseg::client::cli
