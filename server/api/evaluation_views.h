#pragma once

#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/evaluate/evaluate.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "server/api/truth_frames.h"

// Reads the views of EvaluateModel requests with their images, which are taken to the views in the
// way in which the import takes masks; `frames`: the pixels that they are of. Errors are
// INVALID_ARGUMENT and name the field. Both call `check_wanted` before each image and return its
// error.
namespace pepeseg {

// Returns EvaluateModelRequest.views.
absl::StatusOr<std::vector<TruthView>> ReadTruthViews(
    const v1::EvaluateModelRequest& request, const Model& model,
    absl::FunctionRef<absl::Status()> check_wanted, const TruthFrames& frames = TruthFrames());

// Returns EvaluateModelRequest.sam_views. A score of SAM's that is absent in a view where others
// are present becomes 1.
absl::StatusOr<std::vector<SamView>> ReadSamViews(const v1::EvaluateModelRequest& request,
                                                  const Model& model,
                                                  absl::FunctionRef<absl::Status()> check_wanted,
                                                  const TruthFrames& frames = TruthFrames());

}  // namespace pepeseg
