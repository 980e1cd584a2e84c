#pragma once

#include <filesystem>

#include "absl/status/status.h"
#include "clients/cpp/client.h"
#include "pepeseg/v1/evaluation_service.pb.h"

namespace pepeseg::client::cli {

// Draws the worst entities of an evaluation, those with the lowest IoU without any truth, at most
// 3: PREFIX-ENTITY-VIEW.png, the scored view with the lowest IoU, has the outline of the truth
// (green) and what SegmentViews answers to the entity's prompt, with the scale chosen by the server
// (orange). That answer may differ from what the protocol scores. Entities whose prompt is a label
// or a mean of points, and prompts with nothing under them, are left out.
absl::Status DrawWorst(const Client& client, const v1::EvaluateModelRequest& request,
                       const v1::EvaluateModelResponse& response,
                       const std::filesystem::path& prefix);

}  // namespace pepeseg::client::cli
